//! Operators that multiply matrices.

use super::{
    super::{
        budget::Budget,
        shape::{broadcast, matrix_product},
        value::{Value, product},
    },
    Operation,
};

pub(super) fn matrices(operation: &Operation<'_>, budget: &mut Budget) -> Result<Value, String> {
    let weights = operation.input(1)?.real()?;
    multiplied(operation, &operation.x()?.sizes, &weights.sizes, budget)
}

fn multiplied(
    operation: &Operation<'_>,
    a: &[usize],
    b: &[usize],
    budget: &mut Budget,
) -> Result<Value, String> {
    let (sizes, inner) = matrix_product(a, b)?;
    budget.pay(&[product(&sizes), inner])?;
    operation.like_x(sizes)
}

pub(super) fn dense(operation: &Operation<'_>, budget: &mut Budget) -> Result<Value, String> {
    let matrix = |place: usize, transposition: &str| {
        let value = operation.input(place)?.real()?;
        let &[rows, columns] = &value.sizes[..] else {
            return Err(format!("it multiplies {:?}, which is not 2 sizes", value.sizes));
        };
        Ok(match operation.attributes.integer(transposition, 0)? {
            0 => [rows, columns],
            _ => [columns, rows],
        })
    };
    let made = multiplied(operation, &matrix(0, "transA")?, &matrix(1, "transB")?, budget)?;
    match operation.optional(2) {
        Some(bias) if broadcast(&made.sizes, &bias.sizes)? != made.sizes => {
            Err("its bias does not fit".to_owned())
        }
        _ => Ok(made),
    }
}

/// Attention of queries, keys and values with one matrix for each head.
pub(super) fn attention(operation: &Operation<'_>, budget: &mut Budget) -> Result<Value, String> {
    let [queries, keys, values] =
        [0, 1, 2].map(|place| operation.input(place).map(|value| value.sizes.as_slice()));
    let (queries, keys, values) = (queries?, keys?, values?);
    let (&[batch, heads, rows, depth], &[.., places, inner], &[.., summed, columns]) =
        (queries, keys, values)
    else {
        return Err("it takes queries, keys and values of 4 sizes only".to_owned());
    };
    if keys.len() != 4 || values.len() != 4 || inner != depth || summed != places || keys[..2] != values[..2]
    {
        return Err(format!("{queries:?}, {keys:?} and {values:?} do not fit"));
    }
    let groups = keys[1];
    if keys[0] != batch || groups == 0 || !heads.is_multiple_of(groups) {
        return Err(format!("{queries:?} and {keys:?} do not fit"));
    }
    budget.pay(&[batch * heads, rows, places, depth.saturating_add(columns)])?;
    budget.keep(product(&[batch, heads, rows, places]))?;
    operation.like_x(vec![batch, heads, rows, columns])
}
