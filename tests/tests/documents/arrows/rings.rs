//! Dependency cycles of modules: the strongly connected components among the children of one module.

use super::code::{Crate, Place};
use std::collections::{BTreeMap, BTreeSet};

type Arrows = BTreeMap<String, BTreeSet<String>>;

/// Each ring (dependency cycle) of modules, with the module whose children form the ring: names joined by `::`, empty for the
/// crate's root.
pub fn rings(code: &Crate) -> Vec<(String, Vec<String>)> {
    let mut arrows: BTreeMap<Place, Arrows> = BTreeMap::new();
    for place in code.modules.keys() {
        for named in code.named_by(place) {
            let common = place.iter().zip(&named).take_while(|(a, b)| a == b).count();
            // A parent module and its child do not form a ring: the two count as one module.
            if let (Some(from), Some(to)) = (place.get(common), named.get(common)) {
                let among = arrows.entry(place[..common].to_vec()).or_default();
                among.entry(from.clone()).or_default().insert(to.clone());
                among.entry(to.clone()).or_default();
            }
        }
    }
    arrows
        .iter()
        .flat_map(|(parent, arrows)| {
            let parent = parent.join("::");
            components(arrows)
                .into_iter()
                .map(move |ring| (parent.clone(), ring))
        })
        .collect()
}

/// The sets of two or more modules that all reach each other.
fn components(arrows: &Arrows) -> Vec<Vec<String>> {
    let reached: BTreeMap<&String, BTreeSet<&String>> = arrows
        .keys()
        .map(|module| (module, reached_from(arrows, module)))
        .collect();
    let mut left: BTreeSet<&String> = arrows.keys().collect();
    let mut rings = Vec::new();
    while let Some(module) = left.pop_first() {
        let ring: Vec<String> = reached[module]
            .iter()
            .filter(|other| reached[**other].contains(module))
            .map(|other| (*other).clone())
            .collect();
        left.retain(|module| !ring.contains(module));
        if ring.len() > 1 {
            rings.push(ring);
        }
    }
    rings
}

fn reached_from<'a>(arrows: &'a Arrows, module: &'a String) -> BTreeSet<&'a String> {
    let mut reached = BTreeSet::new();
    let mut to_visit = vec![module];
    while let Some(module) = to_visit.pop() {
        for next in &arrows[module] {
            if reached.insert(next) {
                to_visit.push(next);
            }
        }
    }
    reached
}
