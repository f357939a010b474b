//! Shapes of the values in a model, and how operations combine them.

/// A value of the graph: separate for each image of the batch, or constant for all images.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Value {
    /// Sizes of floats that depend on the image, without the first size, which is the batch's.
    Batched(Vec<usize>),
    Constant {
        /// Sizes of the constant; empty for a single number.
        sizes: Vec<usize>,
        /// Values of the constant if they are integers; `None` if they are floats.
        integers: Option<Vec<i64>>,
    },
}

impl Value {
    /// Number of elements per image.
    pub(super) fn elements(&self) -> usize {
        let (Self::Batched(sizes) | Self::Constant { sizes, .. }) = self;
        product(sizes)
    }

    /// The value's sizes, if the value depends on the image.
    pub(super) fn batched(&self) -> Result<&[usize], String> {
        match self {
            Self::Batched(sizes) => Ok(sizes),
            Self::Constant { .. } => Err("it takes a constant where the image belongs".to_owned()),
        }
    }

    /// The value's sizes, if the value is a constant of floats.
    pub(super) fn floats(&self) -> Result<&[usize], String> {
        match self {
            Self::Constant {
                sizes,
                integers: None,
            } => Ok(sizes),
            _ => Err("its weights are not constant floats".to_owned()),
        }
    }

    /// The integers of the value, if the value is a constant of integers.
    pub(super) fn integers(&self) -> Result<&[i64], String> {
        match self {
            Self::Constant {
                integers: Some(integers),
                ..
            } => Ok(integers),
            _ => Err("it takes a shape that is not constant".to_owned()),
        }
    }
}

/// Product of `sizes`, at most `usize::MAX`.
pub(super) fn product(sizes: &[usize]) -> usize {
    sizes.iter().copied().fold(1, usize::saturating_mul)
}

/// Result of an elementwise operation on `a` and `b`, by ONNX's (NumPy's) broadcasting rules.
///
/// The batch must stay the first dimension, so no value may have more dimensions than a value with a batch.
pub(super) fn broadcast(a: &Value, b: &Value) -> Result<Value, String> {
    match (a, b) {
        (Value::Batched(a), Value::Batched(b)) if a.len() == b.len() => {
            Ok(Value::Batched(broadcast_sizes(a, b)?))
        }
        (Value::Batched(_), Value::Batched(_)) => Err("it mixes the images of a batch".to_owned()),
        (Value::Batched(batched), constant) | (constant, Value::Batched(batched)) => {
            let sizes = match constant.floats()? {
                // This constant has one size more than an image: the size of the batch.
                [1, sizes @ ..] if sizes.len() == batched.len() => sizes,
                sizes if sizes.len() <= batched.len() => sizes,
                sizes => return Err(format!("a constant of shape {sizes:?} does not fit the images")),
            };
            Ok(Value::Batched(broadcast_sizes(batched, sizes)?))
        }
        (a, b) => Ok(Value::Constant {
            sizes: broadcast_sizes(a.floats()?, b.floats()?)?,
            integers: None,
        }),
    }
}

fn broadcast_sizes(a: &[usize], b: &[usize]) -> Result<Vec<usize>, String> {
    let (long, short) = if a.len() >= b.len() { (a, b) } else { (b, a) };
    let missing = long.len() - short.len();
    let pairs = long
        .iter()
        .enumerate()
        .map(|(i, &size)| (size, if i < missing { 1 } else { short[i - missing] }));
    pairs
        .map(|(a, b)| match (a, b) {
            (1, size) | (size, 1) => Ok(size),
            (a, b) if a == b => Ok(a),
            _ => Err(format!("shapes {long:?} and {short:?} do not fit")),
        })
        .collect()
}

/// Sizes of an image of `sizes` after a reshape to `target`. In `target`, 0 keeps a size, and a single -1 takes all remaining
/// elements.
///
/// The first entry of `target` is for the batch, which must stay whole.
pub(super) fn reshape(sizes: &[usize], target: &[i64]) -> Result<Vec<usize>, String> {
    let refused = || format!("it reshapes images of {sizes:?} to {target:?}, which does not keep the batch");
    let (&batch, rest) = target.split_first().ok_or_else(refused)?;
    let rest: Vec<Option<usize>> = rest
        .iter()
        .enumerate()
        .map(|(i, &size)| match size {
            -1 => Ok(None),
            0 => sizes.get(i).copied().map(Some).ok_or_else(refused),
            size => usize::try_from(size).map(Some).map_err(|_| refused()),
        })
        .collect::<Result<_, _>>()?;
    let known = product(&rest.iter().flatten().copied().collect::<Vec<_>>());
    let elements = product(sizes);
    match (batch, rest.iter().filter(|size| size.is_none()).count()) {
        (0 | -1, 0) if known == elements => {}
        (0, 1) if known > 0 && elements.is_multiple_of(known) => {}
        _ => return Err(refused()),
    }
    Ok(rest
        .into_iter()
        .map(|size| size.unwrap_or(elements / known.max(1)))
        .collect())
}

/// Sizes of an image of `sizes` after a reduction over `axes`. A reduced axis has size 1 if `kept`, and is removed otherwise.
///
/// Axis 0 is the batch, which must stay whole; negative axes count from the end.
pub(super) fn reduce(sizes: &[usize], axes: &[i64], kept: bool) -> Result<Vec<usize>, String> {
    let refused =
        || format!("it reduces images of {sizes:?} over {axes:?}, which are not axes within an image");
    let rank = sizes.len() as i64 + 1;
    let mut reduced = vec![false; sizes.len()];
    for &axis in axes {
        let from_front = if axis < 0 { axis.saturating_add(rank) } else { axis };
        let place = usize::try_from(from_front.saturating_sub(1)).map_err(|_| refused())?;
        let reduced = reduced.get_mut(place).filter(|reduced| !**reduced);
        *reduced.ok_or_else(refused)? = true;
    }
    // Without `axes`, ONNX would reduce all axes, including the batch.
    if axes.is_empty() {
        return Err(refused());
    }
    let pairs = sizes.iter().zip(reduced);
    let left = pairs.filter_map(|(&size, reduced)| match reduced {
        true => kept.then_some(1),
        false => Some(size),
    });
    Ok(left.collect())
}

/// Size of an axis after a window has slid over it; `None` if the window does not fit.
pub(super) fn slide(size: usize, window: &Window, round_up: bool) -> Option<usize> {
    let reach = (window.kernel.checked_sub(1)?)
        .checked_mul(window.dilation)?
        .checked_add(1)?;
    let room = size
        .checked_add(window.before)?
        .checked_add(window.after)?
        .checked_sub(reach)?;
    let places = if round_up {
        room.div_ceil(window.stride)
    } else {
        room / window.stride
    } + 1;
    // ONNX drops a window that would begin in the padding after the image.
    let beyond = round_up && (places - 1) * window.stride >= size + window.before;
    Some(places - usize::from(beyond))
}

/// The window of a convolution or pooling along one axis. All numbers are at most 1000, and all except the padding are positive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) kernel: usize,
    pub(super) stride: usize,
    pub(super) dilation: usize,
    pub(super) before: usize,
    pub(super) after: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn constant(sizes: &[usize]) -> Value {
        Value::Constant {
            sizes: sizes.to_vec(),
            integers: None,
        }
    }

    #[track_caller]
    fn check_broadcast(a: &Value, b: &Value, expected: Option<&[usize]>) {
        let expected = expected.map(|sizes| Value::Batched(sizes.to_vec()));
        assert_eq!(broadcast(a, b).ok(), expected);
        assert_eq!(broadcast(b, a).ok(), expected, "the other way round");
    }

    #[test]
    fn constants_spread_over_images_and_images_never_over_each_other() {
        let images = Value::Batched(vec![4, 5, 6]);
        check_broadcast(&images, &constant(&[]), Some(&[4, 5, 6]));
        check_broadcast(&images, &constant(&[4, 1, 1]), Some(&[4, 5, 6]));
        check_broadcast(&images, &constant(&[1, 4, 1, 1]), Some(&[4, 5, 6]));
        check_broadcast(&images, &Value::Batched(vec![4, 1, 6]), Some(&[4, 5, 6]));
        check_broadcast(&images, &constant(&[2, 4, 1, 1]), None);
        check_broadcast(&images, &constant(&[3, 1, 1]), None);
        check_broadcast(&images, &constant(&[1, 1, 4, 1, 1]), None);
        check_broadcast(&images, &Value::Batched(vec![6]), None);
    }

    #[test]
    fn a_reshape_keeps_the_batch() {
        let check = |target: &[i64], expected: Option<&[usize]>| {
            assert_eq!(
                reshape(&[4, 5, 6], target).ok().as_deref(),
                expected,
                "{target:?}"
            );
        };
        check(&[-1, 120], Some(&[120]));
        check(&[0, 120], Some(&[120]));
        check(&[0, -1], Some(&[120]));
        check(&[0, 2, -1], Some(&[2, 60]));
        check(&[0, 0, -1], Some(&[4, 30]));
        check(&[0, 0, 0, 0], Some(&[4, 5, 6]));
        check(&[-1, 60], None);
        check(&[0, 60], None);
        check(&[1, 120], None);
        check(&[-1, -1], None);
        check(&[0, 7, -1], None);
        check(&[0, 4, 5, 6, 0], None);
        check(&[0, -2, -60], None);
        check(&[], None);
    }

    #[test]
    fn a_reduction_keeps_the_batch() {
        let check = |axes: &[i64], kept: Option<&[usize]>, dropped: Option<&[usize]>| {
            let made = [true, false].map(|keeps| reduce(&[4, 5, 6], axes, keeps).ok());
            assert_eq!(made.each_ref().map(Option::as_deref), [kept, dropped], "{axes:?}");
        };
        check(&[3], Some(&[4, 5, 1]), Some(&[4, 5]));
        check(&[2, -1], Some(&[4, 1, 1]), Some(&[4]));
        check(&[1, 2, 3], Some(&[1, 1, 1]), Some(&[]));
        for refused in [
            &[0][..],
            &[-4],
            &[],
            &[4],
            &[-5],
            &[2, 2],
            &[3, -1],
            &[i64::MIN],
            &[i64::MAX],
        ] {
            check(refused, None, None);
        }
    }

    #[test]
    fn windows_fit_as_often_as_they_do() {
        let check =
            |size, [kernel, stride, dilation, before, after]: [usize; 5], expected: [Option<usize>; 2]| {
                let window = Window {
                    kernel,
                    stride,
                    dilation,
                    before,
                    after,
                };
                assert_eq!(
                    [false, true].map(|up| slide(size, &window, up)),
                    expected,
                    "{size} {window:?}"
                );
            };
        check(50, [3, 1, 1, 0, 0], [Some(48), Some(48)]);
        check(50, [3, 2, 1, 1, 1], [Some(25), Some(26)]);
        check(13, [3, 2, 1, 1, 1], [Some(7), Some(7)]);
        check(7, [3, 3, 1, 0, 0], [Some(2), Some(3)]);
        // If the size is rounded up, the third window would begin in the padding.
        check(4, [2, 3, 1, 0, 2], [Some(2), Some(2)]);
        check(5, [3, 1, 2, 0, 0], [Some(1), Some(1)]);
        check(5, [3, 1, 3, 0, 0], [None, None]);
    }
}
