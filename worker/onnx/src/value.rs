//! Values of a graph: their shapes, and the numbers of small constants.

use super::tensor_proto::DataType;

/// A value of the graph, for a batch of one image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Value {
    /// All sizes, outermost first; empty for a single number.
    pub(super) sizes: Vec<usize>,
    pub(super) element: Element,
    /// Whether the value depends on the image.
    pub(super) of_image: bool,
    /// The numbers of a small constant, in row-major order; `None` if they are unknown.
    numbers: Option<Vec<f64>>,
}

/// The type of a value's elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Element {
    Float,
    Half,
    Double,
    Integer,
    Integer32,
    Truth,
}

impl Element {
    /// The allowed type with the number `data_type` of the format.
    pub(super) fn of(data_type: i32) -> Option<Self> {
        Some(match DataType::try_from(data_type).ok()? {
            DataType::Float => Self::Float,
            DataType::Float16 => Self::Half,
            DataType::Double => Self::Double,
            DataType::Int64 => Self::Integer,
            DataType::Int32 => Self::Integer32,
            DataType::Bool => Self::Truth,
            DataType::Undefined | DataType::Uint8 => return None,
        })
    }

    /// Number of bytes of an element in a file.
    pub(super) const fn bytes(self) -> usize {
        match self {
            Self::Truth => 1,
            Self::Half => 2,
            Self::Float | Self::Integer32 => 4,
            Self::Double | Self::Integer => 8,
        }
    }

    const fn is_real(self) -> bool {
        matches!(self, Self::Float | Self::Half | Self::Double)
    }

    pub(super) const fn is_whole(self) -> bool {
        matches!(self, Self::Integer | Self::Integer32)
    }

    /// A computed number as ONNX Runtime has it in an element of this type; `None` if that is not known. A model whose shapes were
    /// followed with other numbers could need any memory.
    pub(super) fn held(self, number: f64) -> Option<f64> {
        let is_within = |least: f64, most: f64| number.fract() == 0.0 && (least..=most).contains(&number);
        match self {
            Self::Float => Some(f64::from(number as f32)),
            Self::Double => Some(number),
            Self::Integer => is_within(-MAX_EXACT, MAX_EXACT).then_some(number),
            Self::Integer32 => is_within(i32::MIN.into(), i32::MAX.into()).then_some(number),
            Self::Truth => Some(f64::from(number != 0.0)),
            Self::Half => None,
        }
    }
}

/// Largest whole number up to which a double has every whole number and rounds no other to it.
const MAX_EXACT: f64 = ((1_u64 << 53) - 1) as f64;

impl Value {
    /// Maximum number of elements of a constant whose numbers are kept. Nodes take shapes, axes and scales from such constants.
    pub(super) const MAX_NUMBERS: usize = 1024;

    pub(super) const fn new(sizes: Vec<usize>, element: Element, of_image: bool) -> Self {
        Self {
            sizes,
            element,
            of_image,
            numbers: None,
        }
    }

    /// A constant with known numbers; large constants forget them.
    pub(super) fn constant(sizes: Vec<usize>, element: Element, numbers: Vec<f64>) -> Self {
        let numbers = Some(numbers).filter(|numbers| numbers.len() <= Self::MAX_NUMBERS);
        Self {
            numbers,
            ..Self::new(sizes, element, false)
        }
    }

    /// A list of whole numbers.
    pub(super) fn list(numbers: &[usize]) -> Self {
        let reals = numbers.iter().map(|&number| number as f64).collect();
        Self::constant(vec![numbers.len()], Element::Integer, reals)
    }

    /// This value with other sizes and, if they are known, other numbers.
    pub(super) fn with(&self, sizes: Vec<usize>, numbers: Option<Vec<f64>>) -> Self {
        Self {
            numbers: numbers.filter(|numbers| numbers.len() <= Self::MAX_NUMBERS && !self.of_image),
            ..Self::new(sizes, self.element, self.of_image)
        }
    }

    /// The same numbers with the type `element`.
    pub(super) fn cast(&self, element: Element) -> Self {
        let cast = |number: f64| match element.is_whole() {
            true => element.held(number.trunc()),
            false => element.held(number),
        };
        Self {
            element,
            numbers: self
                .exact()
                .and_then(|numbers| numbers.into_iter().map(cast).collect()),
            ..self.clone()
        }
    }

    /// A value of `sizes` whose element at an index is this value's at `source(index)`.
    pub(super) fn rearranged(&self, sizes: Vec<usize>, source: impl Fn(&[usize]) -> Vec<usize>) -> Self {
        let count = product(&sizes);
        let numbers = self
            .numbers()
            .filter(|_| count <= Self::MAX_NUMBERS)
            .and_then(|numbers| {
                let element = |place: usize| {
                    let source = source(&index_of(place, &sizes));
                    let place = source
                        .iter()
                        .zip(&self.sizes)
                        .fold(0, |place, (at, size)| place * size + at);
                    numbers.get(place).copied()
                };
                (0..count).map(element).collect()
            });
        self.with(sizes, numbers)
    }

    pub(super) fn elements(&self) -> usize {
        product(&self.sizes)
    }

    pub(super) const fn rank(&self) -> usize {
        self.sizes.len()
    }

    pub(super) fn numbers(&self) -> Option<&[f64]> {
        self.numbers.as_deref()
    }

    /// The value, if its elements are real numbers.
    pub(super) fn real(&self) -> Result<&Self, String> {
        match self.element.is_real() {
            true => Ok(self),
            false => Err("it computes with whole numbers, not floats".to_owned()),
        }
    }

    /// The numbers of a constant, if all are exact.
    pub(super) fn exact(&self) -> Option<Vec<f64>> {
        let numbers = self.numbers()?.iter();
        numbers.map(|&number| self.element.held(number)).collect()
    }

    /// The whole numbers of a constant.
    pub(super) fn integers(&self) -> Result<Vec<i64>, String> {
        let numbers = self.exact().filter(|_| self.element.is_whole());
        let numbers = numbers.ok_or("it takes a shape or axes that are not constant")?;
        Ok(numbers.into_iter().map(|number| number as i64).collect())
    }

    /// The whole numbers of a constant, where any number beyond the largest size means the same.
    pub(super) fn bounds(&self) -> Result<Vec<i64>, String> {
        let numbers = self.numbers().filter(|_| self.element.is_whole());
        let numbers = numbers.ok_or("it slices by numbers that are not constant")?;
        Ok(numbers.iter().map(|&number| number as i64).collect())
    }

    /// The place of an axis, which counts from the end if it is negative.
    pub(super) fn axis(&self, axis: i64) -> Result<usize, String> {
        place(axis, self.rank()).ok_or_else(|| format!("{:?} has no axis {axis}", self.sizes))
    }
}

/// The place of `axis` among `rank` axes, counted from the end if it is negative; `None` if there is no such axis.
pub(super) fn place(axis: i64, rank: usize) -> Option<usize> {
    let from_front = if axis < 0 {
        axis.checked_add(rank as i64)?
    } else {
        axis
    };
    usize::try_from(from_front).ok().filter(|&place| place < rank)
}

/// The index of the element at `place` in row-major order.
fn index_of(mut place: usize, sizes: &[usize]) -> Vec<usize> {
    let mut index: Vec<usize> = sizes
        .iter()
        .rev()
        .map(|&size| {
            let at = place % size.max(1);
            place /= size.max(1);
            at
        })
        .collect();
    index.reverse();
    index
}

/// Product of `sizes`, at most `usize::MAX`.
pub(super) fn product(sizes: &[usize]) -> usize {
    sizes.iter().copied().fold(1, usize::saturating_mul)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_that_an_element_can_hold() {
        assert_eq!(Element::Float.held(16_777_217.0), Some(16_777_216.0));
        assert_eq!(Element::Double.held(16_777_217.0), Some(16_777_217.0));
        assert_eq!(Element::Integer.held(MAX_EXACT), Some(MAX_EXACT));
        assert_eq!(Element::Integer.held(MAX_EXACT + 1.0), None);
        assert_eq!(Element::Integer32.held(2_147_483_648.0), None);
        assert_eq!(Element::Truth.held(0.5), Some(1.0));
        for element in [Element::Integer, Element::Integer32] {
            assert_eq!((element.held(0.5), element.held(f64::NAN)), (None, None));
        }
        assert_eq!(Element::Half.held(1.0), None);
    }
}
