//! Operators that slide a window over images.

use super::{
    super::{
        attributes::Attributes,
        budget::Budget,
        shape::{Window, slide},
        value::{Value, product},
    },
    Operation,
};

/// Channels, height and width of the images `x`.
pub(super) fn image(x: &Value) -> Result<[usize; 3], String> {
    match x.sizes[..] {
        [1, channels, height, width] => Ok([channels, height, width]),
        _ => Err(format!("it takes {:?}, not channels x height x width", x.sizes)),
    }
}

pub(super) fn convolution(operation: &Operation<'_>, budget: &mut Budget) -> Result<Value, String> {
    let attributes = operation.attributes;
    let [channels, height, width] = image(operation.x()?)?;
    let weights = operation.input(1)?.real()?;
    let &[filters, depth, kernel_height, kernel_width] = &weights.sizes[..] else {
        return Err(format!(
            "its weights have the shape {:?}, not 4 sizes",
            weights.sizes
        ));
    };
    let groups = usize::try_from(attributes.integer("group", 1)?).unwrap_or(0);
    if groups == 0 || depth.checked_mul(groups) != Some(channels) || !filters.is_multiple_of(groups) {
        return Err(format!(
            "weights of {:?} in {groups} groups do not fit {channels} channels",
            weights.sizes
        ));
    }
    if operation.optional(2).is_some_and(|bias| bias.sizes != [filters]) {
        return Err(format!(
            "its bias is not one number for each of {filters} filters"
        ));
    }
    let kernel = [kernel_height, kernel_width];
    if attributes
        .pair("kernel_shape")?
        .is_some_and(|stated| stated != kernel)
    {
        return Err("its kernel_shape differs from the shape of its weights".to_owned());
    }
    let [height, width] = slid(attributes, [height, width], kernel, false)?;
    budget.pay(&[filters, height, width, depth, kernel_height, kernel_width])?;
    operation.like_x(vec![1, filters, height, width])
}

pub(super) fn pooling(operation: &Operation<'_>, budget: &mut Budget) -> Result<Value, String> {
    let attributes = operation.attributes;
    let [channels, height, width] = image(operation.x()?)?;
    let kernel = attributes.pair("kernel_shape")?.ok_or("it has no kernel_shape")?;
    let round_up = attributes.integer("ceil_mode", 0)? != 0;
    let [height, width] = slid(attributes, [height, width], kernel, round_up)?;
    budget.pay(&[channels, height, width, product(&kernel)])?;
    operation.like_x(vec![1, channels, height, width])
}

/// Sizes of an image after a window of `kernel` has slid over it, according to the attributes.
fn slid(
    attributes: Attributes<'_>,
    sizes: [usize; 2],
    kernel: [usize; 2],
    round_up: bool,
) -> Result<[usize; 2], String> {
    let strides = attributes.pair("strides")?.unwrap_or([1; 2]);
    let dilations = attributes.pair("dilations")?.unwrap_or([1; 2]);
    let pads = match attributes.text("auto_pad", "NOTSET") {
        "NOTSET" => attributes.list::<4>("pads", 0)?.unwrap_or([0; 4]),
        "VALID" => [0; 4],
        // The image is padded until the window fits once for each stride.
        "SAME_UPPER" | "SAME_LOWER" => {
            return Ok([0, 1].map(|axis| sizes[axis].div_ceil(strides[axis])));
        }
        other => return Err(format!("auto_pad = {other:?} is not allowed")),
    };
    let along = |axis: usize| {
        let window = Window {
            kernel: kernel[axis],
            stride: strides[axis],
            dilation: dilations[axis],
            before: pads[axis],
            after: pads[axis + 2],
        };
        slide(sizes[axis], &window, round_up)
            .filter(|&places| places > 0)
            .ok_or_else(|| format!("a window {window:?} does not fit into {} pixels", sizes[axis]))
    };
    Ok([along(0)?, along(1)?])
}
