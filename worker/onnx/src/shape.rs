//! How operations combine the sizes of their inputs. Sizes are whole shapes, outermost first.

use super::value::{place, product};

/// Sizes of an elementwise operation's result, by ONNX's (NumPy's) broadcasting rules.
pub(super) fn broadcast(a: &[usize], b: &[usize]) -> Result<Vec<usize>, String> {
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

/// Sizes after a reshape to `target`. In `target`, a single -1 takes all remaining elements, and 0 keeps a size unless
/// `zero_is_a_size`.
pub(super) fn reshape(sizes: &[usize], target: &[i64], zero_is_a_size: bool) -> Result<Vec<usize>, String> {
    let refused = || format!("it reshapes {sizes:?} to {target:?}, which does not fit");
    let reshaped = target.iter().enumerate().map(|(i, &size)| match size {
        -1 => Ok(None),
        0 if !zero_is_a_size => sizes.get(i).copied().map(Some).ok_or_else(refused),
        size => usize::try_from(size).map(Some).map_err(|_| refused()),
    });
    let reshaped: Vec<Option<usize>> = reshaped.collect::<Result<_, _>>()?;
    let known = product(&reshaped.iter().flatten().copied().collect::<Vec<_>>());
    let elements = product(sizes);
    match reshaped.iter().filter(|size| size.is_none()).count() {
        0 if known == elements => {}
        1 if known > 0 && elements.is_multiple_of(known) => {}
        _ => return Err(refused()),
    }
    let filled = reshaped.into_iter();
    Ok(filled
        .map(|size| size.unwrap_or(elements / known.max(1)))
        .collect())
}

/// Sizes after a reduction over `axes`. A reduced axis has size 1 if `kept`, and is removed otherwise. Negative axes count from the
/// end.
pub(super) fn reduce(sizes: &[usize], axes: &[i64], kept: bool) -> Result<Vec<usize>, String> {
    let chosen = chosen(sizes.len(), axes)
        .ok_or_else(|| format!("it reduces {sizes:?} over {axes:?}, which are not its axes"))?;
    let left = sizes
        .iter()
        .zip(chosen)
        .filter_map(|(&size, reduced)| match reduced {
            true => kept.then_some(1),
            false => Some(size),
        });
    Ok(left.collect())
}

/// For each of `rank` axes, whether `axes` names it; `None` if one of `axes` does not exist or occurs twice.
pub(super) fn chosen(rank: usize, axes: &[i64]) -> Option<Vec<bool>> {
    let mut chosen = vec![false; rank];
    for &axis in axes {
        let place = place(axis, rank)?;
        if std::mem::replace(&mut chosen[place], true) {
            return None;
        }
    }
    Some(chosen)
}

/// Sizes of a matrix product by NumPy's rules, and the number of products per element of the result.
pub(super) fn matrix_product(a: &[usize], b: &[usize]) -> Result<(Vec<usize>, usize), String> {
    let refused = || format!("matrices of {a:?} and {b:?} do not fit");
    let first = if let &[inner] = a {
        vec![1, inner]
    } else {
        a.to_vec()
    };
    let second = if let &[inner] = b {
        vec![inner, 1]
    } else {
        b.to_vec()
    };
    let ([outer_a @ .., rows, inner], [outer_b @ .., other, columns]) = (&first[..], &second[..]) else {
        return Err(refused());
    };
    if inner != other {
        return Err(refused());
    }
    let mut made = broadcast(outer_a, outer_b)?;
    made.extend((a.len() > 1).then_some(*rows));
    made.extend((b.len() > 1).then_some(*columns));
    Ok((made, *inner))
}

/// Number of elements that a slice of an axis takes.
pub(super) fn slice(size: usize, start: i64, end: i64, step: i64) -> Option<usize> {
    let size = i64::try_from(size).ok()?;
    let from_front = |at: i64| if at < 0 { at.saturating_add(size) } else { at };
    let (start, end) = (from_front(start), from_front(end));
    let room = match step {
        0 => return None,
        _ if size == 0 => 0,
        1.. => end.clamp(0, size) - start.clamp(0, size),
        _ => start.clamp(0, size - 1) - end.clamp(-1, size - 1),
    };
    usize::try_from(room.max(0))
        .ok()
        .map(|room| room.div_ceil(step.unsigned_abs() as usize))
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

    #[track_caller]
    fn check_broadcast(a: &[usize], b: &[usize], expected: Option<&[usize]>) {
        assert_eq!(broadcast(a, b).ok().as_deref(), expected);
        assert_eq!(broadcast(b, a).ok().as_deref(), expected, "the other way round");
    }

    #[test]
    fn sizes_of_one_spread() {
        check_broadcast(&[1, 4, 5, 6], &[], Some(&[1, 4, 5, 6]));
        check_broadcast(&[1, 4, 5, 6], &[4, 1, 1], Some(&[1, 4, 5, 6]));
        check_broadcast(&[1, 4, 1, 6], &[4, 5, 1], Some(&[1, 4, 5, 6]));
        check_broadcast(&[1, 4, 5, 6], &[3, 1, 1], None);
    }

    #[test]
    fn a_reshape_keeps_all_elements() {
        let check = |target: &[i64], zero_is_a_size, expected: Option<&[usize]>| {
            let made = reshape(&[1, 4, 5, 6], target, zero_is_a_size).ok();
            assert_eq!(made.as_deref(), expected, "{target:?} {zero_is_a_size}");
        };
        check(&[-1, 120], false, Some(&[1, 120]));
        check(&[0, -1], false, Some(&[1, 120]));
        check(&[0, 0, -1], false, Some(&[1, 4, 30]));
        check(&[1, 120], true, Some(&[1, 120]));
        check(&[120], false, Some(&[120]));
        check(&[2, -1], false, Some(&[2, 60]));
        check(&[0, -1], true, None);
        check(&[-1, -1], false, None);
        check(&[0, 60], false, None);
        check(&[0, 7, -1], false, None);
        check(&[0, 4, 5, 6, 0], false, None);
        check(&[0, -2, -60], false, None);
        check(&[], false, None);
    }

    #[test]
    fn a_reduction_names_each_axis_once() {
        let check = |axes: &[i64], kept: Option<&[usize]>, dropped: Option<&[usize]>| {
            let made = [true, false].map(|keeps| reduce(&[1, 4, 5, 6], axes, keeps).ok());
            assert_eq!(made.each_ref().map(Option::as_deref), [kept, dropped], "{axes:?}");
        };
        check(&[3], Some(&[1, 4, 5, 1]), Some(&[1, 4, 5]));
        check(&[2, -1], Some(&[1, 4, 1, 1]), Some(&[1, 4]));
        check(&[1, 2, 3], Some(&[1, 1, 1, 1]), Some(&[1]));
        for refused in [&[4][..], &[-5], &[2, 2], &[3, -1], &[i64::MIN], &[i64::MAX]] {
            check(refused, None, None);
        }
    }

    #[test]
    fn matrices_multiply_by_numpys_rules() {
        let check = |a: &[usize], b: &[usize], expected: Option<(&[usize], usize)>| {
            let made = matrix_product(a, b).ok();
            let made = made.as_ref().map(|(sizes, inner)| (sizes.as_slice(), *inner));
            assert_eq!(made, expected, "{a:?} {b:?}");
        };
        check(&[1, 8], &[8, 3], Some((&[1, 3], 8)));
        check(&[1, 2, 5, 4], &[1, 2, 4, 5], Some((&[1, 2, 5, 5], 4)));
        check(&[7, 5, 4], &[4, 3], Some((&[7, 5, 3], 4)));
        check(&[4], &[4, 3], Some((&[3], 4)));
        check(&[2, 4], &[4], Some((&[2], 4)));
        check(&[4], &[4], Some((&[], 4)));
        check(&[1, 8], &[7, 3], None);
        check(&[2, 5, 4], &[3, 4, 5], None);
        check(&[], &[3], None);
    }

    #[test]
    fn slices_take_what_numpy_takes() {
        let check = |[start, end, step]: [i64; 3], expected| {
            assert_eq!(slice(6, start, end, step), expected, "{start}:{end}:{step}");
        };
        check([0, i64::MAX, 1], Some(6));
        check([1, -1, 1], Some(4));
        check([0, 6, 4], Some(2));
        check([-1, i64::MIN, -1], Some(6));
        check([4, 1, -2], Some(2));
        check([5, 2, 1], Some(0));
        check([9, 12, 1], Some(0));
        check([0, 6, 0], None);
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
