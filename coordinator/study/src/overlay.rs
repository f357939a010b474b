//! Laying one table of a study file over another.

use toml::{Table, Value};

/// Lays `over` on `base`: a table in both is laid over in turn, every other value is replaced.
pub(crate) fn lay_over(base: &mut Table, over: &Table) {
    for (name, value) in over {
        match (base.get_mut(name), value) {
            (Some(Value::Table(below)), Value::Table(above)) => lay_over(below, above),
            _ => {
                base.insert(name.clone(), value.clone());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_joined_and_other_values_replaced() {
        let table = |text: &str| text.parse::<Table>().unwrap();
        let mut base = table("a = 1\nb = [1, 2]\n[c]\nd = 1\ne = 2\n[c.f]\ng = 1");
        lay_over(&mut base, &table("b = [3]\n[c]\nd = 4\n[c.f]\nh = 5\n[i]\nj = 6"));
        let expected = "a = 1\nb = [3]\n[c]\nd = 4\ne = 2\n[c.f]\ng = 1\nh = 5\n[i]\nj = 6";
        assert_eq!(base, table(expected));
    }
}
