//! Operators that normalise numbers by the other numbers of the same image.

use super::{
    super::{shape::broadcast, value::Value},
    Operation,
};

/// Normalisation of channels, or of groups of channels.
pub(super) fn by_channel(operation: &Operation<'_>) -> Result<Value, String> {
    let attributes = operation.attributes;
    if attributes.integer("training_mode", 0)? != 0 {
        return Err("it is in training mode".to_owned());
    }
    let x = operation.x()?;
    let groups = usize::try_from(attributes.integer("num_groups", 1)?).unwrap_or(0);
    let &channels = x.sizes.get(1).ok_or("it has no channels")?;
    if groups == 0 || !channels.is_multiple_of(groups) {
        return Err(format!("{channels} channels do not make {groups} groups"));
    }
    for parameter in operation.inputs().skip(1) {
        let sizes = &parameter.real()?.sizes[..];
        // Before version 21 of the operators, a group normalisation has one parameter per group.
        if sizes != [channels] && sizes != [groups] {
            return Err(format!(
                "its parameters are of shape {sizes:?} for {channels} channels"
            ));
        }
    }
    operation.like_x(x.sizes.clone())
}

/// Normalisation over the last axes, from `axis` on.
pub(super) fn by_layer(operation: &Operation<'_>) -> Result<Value, String> {
    let x = operation.x()?;
    let axis = x.axis(operation.attributes.integer("axis", -1)?)?;
    for parameter in operation.inputs().skip(1) {
        if broadcast(&x.sizes[axis..], &parameter.real()?.sizes)? != x.sizes[axis..] {
            return Err(format!(
                "its parameters are of shape {:?} for {:?}",
                parameter.sizes, x.sizes
            ));
        }
    }
    operation.like_x(x.sizes.clone())
}

/// Normalisation along one axis.
pub(super) fn along_axis(operation: &Operation<'_>) -> Result<Value, String> {
    let x = operation.x()?;
    // Before version 13, a softmax is over all axes from 1 on.
    let is_old = operation.opset < 13 && operation.operator != "LpNormalization";
    x.axis(
        operation
            .attributes
            .integer("axis", if is_old { 1 } else { -1 })?,
    )?;
    operation.like_x(x.sizes.clone())
}
