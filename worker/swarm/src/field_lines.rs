//! Finds the line of a field in a campaign file.

use toml::de::{DeTable, DeValue};

/// The line, from 1, on which a campaign file sets a field, such as `search.population` or `species[1].name`; `None` if the file
/// does not set the field. For a field that is missing in a list, the line is that of the closest item or list. If the file has
/// no such path, because `field` lacks the names of tables, the line is that of the only field with the same last name.
#[must_use]
pub fn line_of_field(text: &str, field: &str) -> Option<usize> {
    let table = DeTable::parse(text).ok()?;
    let mut places = Vec::new();
    fields_of(table.get_ref(), "", &mut places);
    let exact = |path: &str| places.iter().find(|(known, _)| known == path);
    let in_list = || lists_of(field).find_map(exact);
    let only = || {
        let last = last_name(field);
        let is_meant = |path: &str| !path.ends_with(']') && last_name(path) == last;
        let mut named = places.iter().filter(|(path, _)| is_meant(path));
        named.next().filter(|_| named.next().is_none())
    };
    let (_, start) = exact(field).or_else(in_list).or_else(only)?;
    Some(1 + text.get(..*start)?.matches('\n').count())
}

/// Lists that contain a field, the closest first: `species[1]` and `species` of `species[1].name`. Empty for a field outside
/// lists.
fn lists_of(field: &str) -> impl Iterator<Item = &str> {
    let ends = field.rmatch_indices(['.', '[']).map(|(end, _)| end);
    ends.filter(move |_| field.contains('['))
        .filter_map(move |end| field.get(..end))
}

/// The last name of a path: `sees` of `robot.sensors[0].sees`, and `angles` of `controllers.angles[3]`.
fn last_name(path: &str) -> &str {
    let last = path.rsplit('.').next().unwrap_or_default();
    last.split('[').next().unwrap_or_default()
}

/// The paths of the fields of a table and of the tables in it, with the place in the text where each begins.
fn fields_of(table: &DeTable<'_>, path: &str, places: &mut Vec<(String, usize)>) {
    for (name, value) in table {
        let path = match path {
            "" => name.get_ref().to_string(),
            path => format!("{path}.{}", name.get_ref()),
        };
        places.push((path.clone(), name.span().start));
        match value.get_ref() {
            DeValue::Table(inner) => fields_of(inner, &path, places),
            DeValue::Array(values) => {
                for (place, value) in values.iter().enumerate() {
                    if let Some(table) = value.get_ref().as_table() {
                        let path = format!("{path}[{place}]");
                        places.push((path.clone(), value.span().start));
                        fields_of(table, &path, places);
                    }
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_of_a_field_is_found() {
        let text = "model = \"single-sensor\"\nmethod = \"latent\"\n[search]\n# how many\npopulation = 0\n[[species]]\nname = \"a\"\n";
        for (field, line) in [
            ("model", Some(1)),
            ("search.population", Some(5)),
            ("population", Some(5)),
            ("species[0].name", Some(7)),
            ("search.generations", None),
            ("nothing", None),
        ] {
            assert_eq!(line_of_field(text, field), line, "{field}");
        }
        assert_eq!(line_of_field("no TOML", "model"), None);
    }

    #[test]
    fn the_line_of_a_field_in_a_list_is_that_of_its_item() {
        let text = "ratios = [\n  [1, 4],\n]\n[[species]]\nname = \"a\"\nshare = 0.5\n[[species]]\nname = \"b\"\n\
                    share = 0.5\n[species.robot]\nsensors = [\n  { sees = [\"walls\"] },\n  { sees = [\"c\"] },\n]\n";
        for (field, line) in [
            ("species[0].name", Some(5)),
            ("species[1].name", Some(8)),
            ("species[0].share", Some(6)),
            ("species[1].share", Some(9)),
            ("species[1].robot.sensors[0].sees", Some(12)),
            ("species[1].robot.sensors[1].sees", Some(13)),
            // The line of a missing field is that of the closest list or item.
            ("species[0].count", Some(4)),
            ("species[1].robot.sensors[1].angle", Some(13)),
            ("species[7].name", Some(4)),
            ("ratios[0][1]", Some(1)),
            ("name", None),
        ] {
            assert_eq!(line_of_field(text, field), line, "{field}");
        }
    }
}
