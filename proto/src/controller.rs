//! The genome of a controller: wheel speeds for each sensor state, and the second sensor's angle.

use crate::{CapabilityModel, Invalid, invalid};
use std::{f64::consts::PI, fmt};

/// A controller (paper, Eq. 2 and Eq. 4): every wheel speed in \[-1, 1\], the angle in \[-pi, pi\] radians.
///
/// Negative zero becomes zero, so that equal controllers have equal bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Controller {
    genes: Genes,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Genes {
    SingleSensor([f64; 4]),
    TwoSensor([f64; 9]),
}

impl Controller {
    /// A controller for `model` from its genes: `[vl0, vr0, vl1, vr1]`, or eight wheel speeds and the angle.
    ///
    /// # Errors
    /// Says which gene is out of range, or how many genes there should have been.
    pub fn new(model: CapabilityModel, genes: &[f64]) -> Result<Self, Invalid> {
        if genes.len() != model.genes() {
            let allowed = format!("{} values for the {model} model", model.genes());
            return Err(Invalid::new("controller", format!("{genes:?}"), allowed));
        }
        let (speeds, angles) = genes.split_at(model.speeds());
        for (i, &speed) in speeds.iter().enumerate() {
            invalid::real(&format!("controller[{i}]"), speed, -1.0..=1.0)?;
        }
        for &angle in angles {
            invalid::real(&format!("controller[{}]", model.speeds()), angle, -PI..=PI)?;
        }
        let gene = |i: usize| genes[i] + 0.0;
        Ok(Self {
            genes: match model {
                CapabilityModel::SingleSensor => Genes::SingleSensor(std::array::from_fn(gene)),
                CapabilityModel::TwoSensor => Genes::TwoSensor(std::array::from_fn(gene)),
            },
        })
    }

    /// The controller's capability model.
    #[must_use]
    pub const fn model(&self) -> CapabilityModel {
        match self.genes {
            Genes::SingleSensor(_) => CapabilityModel::SingleSensor,
            Genes::TwoSensor(_) => CapabilityModel::TwoSensor,
        }
    }

    /// All genes: 4 or 9.
    #[must_use]
    pub const fn genes(&self) -> &[f64] {
        match &self.genes {
            Genes::SingleSensor(genes) => genes,
            Genes::TwoSensor(genes) => genes,
        }
    }

    /// The wheel speeds, (left, right) for each sensor state: 4 or 8.
    #[must_use]
    pub fn speeds(&self) -> &[f64] {
        &self.genes()[..self.model().speeds()]
    }

    /// The second sensor's angle from straight ahead, radians; `None` for the single-sensor model.
    #[must_use]
    pub const fn angle(&self) -> Option<f64> {
        match &self.genes {
            Genes::SingleSensor(_) => None,
            Genes::TwoSensor(genes) => Some(genes[8]),
        }
    }
}

impl fmt::Display for Controller {
    /// `[0.6, 1, 0.4, 0.5]`; the angle, if there is one, with four decimals.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("[")?;
        for (i, speed) in self.speeds().iter().enumerate() {
            write!(f, "{}{speed}", if i == 0 { "" } else { ", " })?;
        }
        match self.angle() {
            Some(angle) => write!(f, ", {angle:.4}]"),
            None => f.write_str("]"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wrong_number_of_genes_is_named() {
        let error = Controller::new(CapabilityModel::TwoSensor, &[0.0; 4]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "controller = [0.0, 0.0, 0.0, 0.0]: must be 9 values for the two-sensor model"
        );
    }

    #[test]
    fn a_gene_out_of_range_or_not_a_number_is_named() {
        for bad in [1.1, f64::NAN, f64::INFINITY] {
            let error = Controller::new(CapabilityModel::SingleSensor, &[0.0, bad, 0.0, 0.0]).unwrap_err();
            assert_eq!(error.field, "controller[1]");
        }
    }

    #[test]
    fn negative_zero_is_zero() {
        let controller = Controller::new(CapabilityModel::SingleSensor, &[-0.0; 4]).unwrap();
        assert!(controller.genes().iter().all(|gene| gene.is_sign_positive()));
    }
}
