//! Operators that move, repeat, choose or describe numbers without computing with them.

use super::{
    super::{
        attribute_proto::AttributeType,
        limits::MAX_VALUE_ELEMENTS,
        shape::{broadcast, chosen, reshape, slice},
        tensor,
        value::{Element, Value, place, product},
    },
    Operation,
};

pub(super) fn output(operation: &Operation<'_>) -> Result<Value, String> {
    let sizes = &operation.input(0)?.sizes[..];
    match operation.operator {
        "Concat" => concat(operation),
        "ConstantOfShape" => constant_of_shape(operation),
        "DepthToSpace" | "SpaceToDepth" => depth(operation),
        "Expand" => expand(operation),
        "Flatten" => {
            // The axis may be the rank: then all axes are before it.
            let axis = operation.attributes.integer("axis", 1)?;
            let axis = if axis < 0 { axis + sizes.len() as i64 } else { axis };
            let axis = usize::try_from(axis).ok().filter(|&axis| axis <= sizes.len());
            let (before, after) = sizes.split_at(axis.ok_or("it flattens from an axis that is not there")?);
            moved(operation, vec![product(before), product(after)])
        }
        "Gather" => gather(operation),
        "Pad" => pad(operation),
        "Range" => range(operation),
        "Reshape" => {
            let zero_is_a_size = operation.attributes.integer("allowzero", 0)? != 0;
            moved(
                operation,
                reshape(sizes, &operation.input(1)?.integers()?, zero_is_a_size)?,
            )
        }
        "Resize" => resize(operation),
        "Shape" => shape(operation),
        "Size" => Ok(Value::constant(
            Vec::new(),
            Element::Integer,
            vec![product(sizes) as f64],
        )),
        "Slice" => sliced(operation),
        "Squeeze" => squeeze(operation),
        "Tile" => tile(operation),
        "Transpose" => transpose(operation),
        "Unsqueeze" => unsqueeze(operation),
        other => Err(format!("{other} is not known")),
    }
}

/// The first input's numbers in their order, with other sizes.
fn moved(operation: &Operation<'_>, sizes: Vec<usize>) -> Result<Value, String> {
    let x = operation.input(0)?;
    Ok(x.with(sizes, x.numbers().map(<[f64]>::to_vec)))
}

fn concat(operation: &Operation<'_>) -> Result<Value, String> {
    let first = operation.input(0)?;
    let axis = first.axis(operation.attributes.integer("axis", 0)?)?;
    let mut sizes = first.sizes.clone();
    sizes[axis] = 0;
    let mut numbers = Some(Vec::new());
    for input in operation.inputs() {
        let &along = input.sizes.get(axis).ok_or("its inputs do not fit")?;
        let mut others = input.sizes.clone();
        others[axis] = sizes[axis];
        if others != sizes || input.element != first.element {
            return Err(format!("{:?} does not fit {:?}", input.sizes, first.sizes));
        }
        sizes[axis] = sizes[axis].saturating_add(along);
        numbers = numbers
            .zip(input.numbers())
            .map(|(all, more)| [&all, more].concat());
    }
    let is_list = sizes.len() == 1;
    let value = operation.like_x(sizes.clone())?;
    Ok(value.with(sizes, numbers.filter(|_| is_list)))
}

fn sizes_of(value: &Value) -> Result<Vec<usize>, String> {
    let sizes = value.integers()?;
    let sizes = sizes
        .iter()
        .map(|&size| usize::try_from(size).map_err(|_| format!("it makes the size {size}")));
    sizes.collect()
}

fn constant_of_shape(operation: &Operation<'_>) -> Result<Value, String> {
    let sizes = sizes_of(operation.input(0)?)?;
    let (element, number) = match operation.attributes.find("value") {
        None => (Element::Float, Some(0.0)),
        Some(value) => match (value.r#type(), &value.t) {
            (AttributeType::Tensor, Some(held)) => {
                let held = tensor::constant(held)?;
                (
                    held.element,
                    held.numbers().and_then(|numbers| numbers.first().copied()),
                )
            }
            _ => return Err("its value is not a tensor".to_owned()),
        },
    };
    let value = Value::new(sizes.clone(), element, false);
    let count = value.elements();
    let number = number.filter(|_| count <= Value::MAX_NUMBERS);
    Ok(value.with(sizes, number.map(|number| vec![number; count])))
}

fn depth(operation: &Operation<'_>) -> Result<Value, String> {
    let &[batch, channels, height, width] = &operation.input(0)?.sizes[..] else {
        return Err("it takes 4 sizes".to_owned());
    };
    let block = operation.attributes.count("blocksize", 0)?;
    let area = block.saturating_mul(block);
    let divided = |size: usize, by: usize| {
        let whole = size.is_multiple_of(by).then(|| size / by);
        whole.ok_or_else(|| format!("blocks of {block} do not fit"))
    };
    operation.like_x(match operation.operator {
        "DepthToSpace" => vec![
            batch,
            divided(channels, area)?,
            height.saturating_mul(block),
            width.saturating_mul(block),
        ],
        _ => vec![
            batch,
            channels.saturating_mul(area),
            divided(height, block)?,
            divided(width, block)?,
        ],
    })
}

fn expand(operation: &Operation<'_>) -> Result<Value, String> {
    let sizes = broadcast(&operation.input(0)?.sizes, &sizes_of(operation.input(1)?)?)?;
    operation.like_x(sizes)
}

fn gather(operation: &Operation<'_>) -> Result<Value, String> {
    let (x, places) = (operation.input(0)?, operation.input(1)?);
    let axis = x.axis(operation.attributes.integer("axis", 0)?)?;
    let size = x.sizes[axis];
    let chosen = places.integers()?;
    let chosen = chosen.iter().map(|&at| {
        let missing = || format!("it takes element {at} of {size}");
        place(at, size).ok_or_else(missing)
    });
    let chosen: Vec<usize> = chosen.collect::<Result<_, _>>()?;
    let sizes = [&x.sizes[..axis], &places.sizes, &x.sizes[axis + 1..]].concat();
    let inner = places.rank();
    Ok(x.rearranged(sizes, |index| {
        let (before, rest) = index.split_at(axis);
        let (of_places, after) = rest.split_at(inner);
        let along = of_places.iter().zip(&places.sizes);
        let place = along.fold(0, |place, (at, size)| place * size + at);
        [before, &[chosen.get(place).copied().unwrap_or_default()], after].concat()
    }))
}

fn pad(operation: &Operation<'_>) -> Result<Value, String> {
    let x = operation.input(0)?;
    let pads = operation.integers("pads", 1)?.ok_or("it has no pads")?;
    let all: Vec<i64> = (0..x.rank() as i64).collect();
    let axes = match operation.optional(3) {
        Some(axes) => axes.integers()?,
        None => all,
    };
    if pads.len() != 2 * axes.len() || chosen(x.rank(), &axes).is_none() {
        return Err(format!("{pads:?} are not two numbers for each of its axes"));
    }
    let mut sizes = x.sizes.clone();
    for (i, &axis) in axes.iter().enumerate() {
        let axis = x.axis(axis)?;
        let padded = (sizes[axis] as i64)
            .saturating_add(pads[i])
            .saturating_add(pads[i + axes.len()]);
        sizes[axis] = usize::try_from(padded).map_err(|_| format!("{pads:?} leave nothing"))?;
    }
    operation.like_x(sizes)
}

fn range(operation: &Operation<'_>) -> Result<Value, String> {
    let number = |place: usize| match operation.input(place)?.exact().as_deref() {
        Some(&[number]) => Ok(number),
        _ => Err("it counts to a number that is not constant".to_owned()),
    };
    let (start, end, step) = (number(0)?, number(1)?, number(2)?);
    let element = operation.input(0)?.element;
    let count = element.held(end - start).map(|length| (length / step).ceil());
    let count = count.filter(|count| (0.0..=MAX_VALUE_ELEMENTS as f64).contains(count));
    let count = count.ok_or_else(|| format!("it counts from {start} to {end} by {step}"))? as usize;
    // ONNX Runtime adds the steps of real numbers one after the other, with an error each.
    let is_known = element.is_whole() && count <= Value::MAX_NUMBERS;
    let numbers = is_known.then(|| (0..count).map(|i| start + i as f64 * step).collect());
    Ok(Value::new(vec![count], element, false).with(vec![count], numbers))
}

fn resize(operation: &Operation<'_>) -> Result<Value, String> {
    let x = operation.x()?;
    if operation.attributes.find("axes").is_some() {
        return Err("it resizes chosen axes, which is not allowed: state all sizes".to_owned());
    }
    if operation.attributes.text("keep_aspect_ratio_policy", "stretch") != "stretch" {
        return Err("it keeps an aspect ratio, which is not allowed: state all sizes".to_owned());
    }
    // Version 10 has the scales as its second input, later versions as their third.
    let scales = operation.optional(if operation.opset < 11 { 1 } else { 2 });
    let sizes = match (
        operation.optional(3),
        scales.filter(|scales| scales.elements() > 0),
    ) {
        (Some(sizes), _) => sizes_of(sizes)?,
        (None, Some(scales)) => {
            let scales = scales.numbers().ok_or("its scales are not constant")?;
            // In single precision, as ONNX Runtime computes it.
            let scaled = x
                .sizes
                .iter()
                .zip(scales)
                .map(|(&size, &scale)| size as f32 * scale as f32);
            scaled.map(|size| size.clamp(0.0, 1e9) as usize).collect()
        }
        (None, None) => return Err("it has neither sizes nor scales".to_owned()),
    };
    if sizes.len() != x.rank() {
        return Err(format!("it resizes {:?} to {sizes:?}", x.sizes));
    }
    operation.like_x(sizes)
}

fn shape(operation: &Operation<'_>) -> Result<Value, String> {
    let sizes = &operation.input(0)?.sizes;
    let rank = sizes.len() as i64;
    let place = |name, default| -> Result<usize, String> {
        let at = operation.attributes.integer(name, default)?;
        let at = if at < 0 { at.saturating_add(rank) } else { at };
        Ok(at.clamp(0, rank) as usize)
    };
    let (start, end) = (place("start", 0)?, place("end", rank)?);
    Ok(Value::list(&sizes[start..end.max(start)]))
}

fn sliced(operation: &Operation<'_>) -> Result<Value, String> {
    let x = operation.input(0)?;
    let bounds = |name: &str, place| match operation.optional(place) {
        Some(input) => input.bounds(),
        None => {
            let given = operation.attributes.integers(name)?;
            given
                .map(<[i64]>::to_vec)
                .ok_or_else(|| format!("it has no {name}"))
        }
    };
    let (starts, ends) = (bounds("starts", 1)?, bounds("ends", 2)?);
    let axes = operation.integers("axes", 3)?;
    let axes = axes.unwrap_or_else(|| (0..starts.len() as i64).collect());
    let steps = match operation.optional(4) {
        Some(steps) => steps.bounds()?,
        None => vec![1; starts.len()],
    };
    let is_sound =
        [ends.len(), axes.len(), steps.len()] == [starts.len(); 3] && chosen(x.rank(), &axes).is_some();
    if !is_sound {
        return Err("its starts, ends, axes and steps do not fit".to_owned());
    }
    let mut sizes = x.sizes.clone();
    // The first element and the step along each axis.
    let mut taken: Vec<(i64, i64)> = vec![(0, 1); x.rank()];
    for (i, &axis) in axes.iter().enumerate() {
        let axis = x.axis(axis)?;
        let size = sizes[axis] as i64;
        let start = if starts[i] < 0 {
            starts[i].saturating_add(size)
        } else {
            starts[i]
        };
        let last = if steps[i] < 0 { size - 1 } else { size };
        taken[axis] = (start.clamp(0, last.max(0)), steps[i]);
        sizes[axis] = slice(sizes[axis], starts[i], ends[i], steps[i]).ok_or("its step is 0")?;
    }
    Ok(x.rearranged(sizes, |index| {
        let along = index.iter().zip(&taken);
        along
            .map(|(&at, &(start, step))| (start + at as i64 * step) as usize)
            .collect()
    }))
}

pub(super) fn split(operation: &Operation<'_>) -> Result<Vec<Value>, String> {
    operation.expect_inputs(1, 2)?;
    let x = operation.input(0)?;
    let axis = x.axis(operation.attributes.integer("axis", 0)?)?;
    let (size, count) = (x.sizes[axis], operation.outputs.max(1));
    let parts = match operation.integers("split", 1)? {
        Some(parts) => parts
            .iter()
            .map(|&part| usize::try_from(part).unwrap_or(usize::MAX))
            .collect(),
        None => {
            let part = size.div_ceil(count);
            let mut parts = vec![part; count];
            parts[count - 1] = size.saturating_sub(part.saturating_mul(count - 1));
            parts
        }
    };
    let total = parts.iter().copied().fold(0, usize::saturating_add);
    if parts.len() != count || total != size {
        return Err(format!("it splits {size} into {parts:?}"));
    }
    let part = |part: usize| {
        let mut sizes = x.sizes.clone();
        sizes[axis] = part;
        x.with(sizes, None)
    };
    Ok(parts.into_iter().map(part).collect())
}

fn squeeze(operation: &Operation<'_>) -> Result<Value, String> {
    let x = operation.input(0)?;
    let squeezed = match operation.integers("axes", 1)? {
        Some(axes) => chosen(x.rank(), &axes).ok_or_else(|| format!("{axes:?} are not its axes"))?,
        None => x.sizes.iter().map(|&size| size == 1).collect(),
    };
    let pairs = || x.sizes.iter().zip(&squeezed);
    if pairs().any(|(&size, &squeezed)| squeezed && size != 1) {
        return Err(format!(
            "it squeezes an axis of {:?} that has another size than 1",
            x.sizes
        ));
    }
    moved(
        operation,
        pairs()
            .filter(|(_, squeezed)| !**squeezed)
            .map(|(&size, _)| size)
            .collect(),
    )
}

fn tile(operation: &Operation<'_>) -> Result<Value, String> {
    let (x, repeats) = (operation.input(0)?, sizes_of(operation.input(1)?)?);
    if repeats.len() != x.rank() {
        return Err(format!("it repeats {:?} by {repeats:?}", x.sizes));
    }
    let sizes = x.sizes.iter().zip(repeats);
    operation.like_x(sizes.map(|(&size, times)| size.saturating_mul(times)).collect())
}

fn transpose(operation: &Operation<'_>) -> Result<Value, String> {
    let x = operation.input(0)?;
    let reversed: Vec<i64> = (0..x.rank() as i64).rev().collect();
    let order = operation.attributes.integers("perm")?.unwrap_or(&reversed);
    if order.len() != x.rank() || chosen(x.rank(), order).is_none() {
        return Err(format!("{order:?} is no order of its axes"));
    }
    let order: Vec<usize> = order.iter().map(|&axis| x.axis(axis)).collect::<Result<_, _>>()?;
    let sizes = order.iter().map(|&axis| x.sizes[axis]).collect();
    Ok(x.rearranged(sizes, |index| {
        let mut source = vec![0; order.len()];
        for (&axis, &at) in order.iter().zip(index) {
            source[axis] = at;
        }
        source
    }))
}

fn unsqueeze(operation: &Operation<'_>) -> Result<Value, String> {
    let x = operation.input(0)?;
    let axes = operation.integers("axes", 1)?.ok_or("it has no axes")?;
    let rank = x.rank().saturating_add(axes.len());
    let added = (rank <= 64).then(|| chosen(rank, &axes)).flatten();
    let added = added.ok_or_else(|| format!("it cannot add the axes {axes:?} to {:?}", x.sizes))?;
    let mut others = x.sizes.iter().copied();
    let sizes = added
        .into_iter()
        .map(|is_new| if is_new { 1 } else { others.next().unwrap_or(1) });
    moved(operation, sizes.collect())
}
