//! Finds the pixels of a convolution's input and output that meet under each part of the kernel.
//!
//! Pixels that meet the same parts of the kernel form a group: the interior of a picture, its edges and its corners. A group
//! needs no padding, so nothing is multiplied by zeros, and no pixel needs a bounds check of its own.

use murmuration_swarm::training::Shape;
use std::collections::BTreeMap;

/// All meetings of input and output pixels in a block of samples.
#[derive(Debug)]
pub(super) struct Meetings {
    /// Number of samples in a block.
    pub(super) samples: usize,
    /// Groups of output pixels.
    pub(super) outputs: Vec<Group>,
    /// Groups of input pixels.
    pub(super) inputs: Vec<Group>,
    /// Strips of every row of the kernel.
    pub(super) strips: Vec<Strip>,
}

/// Pixels whose values are sums over the same parts of the kernel.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) spans: Vec<Span>,
    pub(super) places: Places,
}

/// A part of the kernel whose weights are adjacent in memory.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    /// Index of the span's first row in the packed weights.
    pub(super) row: usize,
    /// Offset, from a place's source, of the values that the span is multiplied with.
    pub(super) shift: usize,
    /// Number of the span's rows, which is also the number of values.
    pub(super) len: usize,
}

/// A part of a row of the kernel, and the pixels for which the whole part lies in the picture.
#[derive(Debug)]
pub(super) struct Strip {
    /// Index of the strip's first weight in a patch.
    pub(super) row: usize,
    /// Number of weights.
    pub(super) len: usize,
    pub(super) places: Places,
}

/// Pixels of a block of samples, sample after sample.
#[derive(Debug)]
pub(super) struct Places {
    places: Vec<Place>,
    per_sample: usize,
}

/// A pixel, and the offset of the values that it meets.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Place {
    /// Index of the pixel in the block.
    pub(super) pixel: u32,
    /// Offset in the block of the first value that the pixel meets.
    pub(super) source: u32,
}

impl Places {
    /// The places of the first `samples` samples.
    pub(super) fn of(&self, samples: usize) -> &[Place] {
        &self.places[..samples * self.per_sample]
    }
}

/// Maximum number of values of a block's input and output, which should stay in a core's cache.
const VALUES_AT_ONCE: usize = 1 << 16;

/// The numbers of a convolution.
#[derive(Debug, Clone, Copy)]
pub(super) struct Geometry {
    pub(super) input: Shape,
    pub(super) output: Shape,
    pub(super) kernel: usize,
    pub(super) stride: usize,
    pub(super) padding: usize,
}

impl Meetings {
    pub(super) fn new(geometry: Geometry) -> Self {
        let Geometry {
            input,
            output,
            kernel,
            ..
        } = geometry;
        let samples = (VALUES_AT_ONCE / (input.len() + output.len())).clamp(1, 16);
        // A power of two divides the chunks of trainings.
        let samples = 1 << samples.ilog2();
        let by_output = axis(output.side, |pixel| geometry.under(pixel));
        let by_input = axis(input.side, |pixel| geometry.over(pixel));
        let channels = input.channels;
        let group = |rows: &Lines, columns: &Lines| {
            let spans = rows.parts.iter().map(|part| Span {
                row: (part.kernel * kernel + columns.first()) * channels,
                shift: part.shift * input.side * channels,
                len: columns.parts.len() * channels,
            });
            Group {
                spans: spans.filter(|span| span.len > 0).collect(),
                places: places(rows, columns, [output, input], samples),
            }
        };
        let back = |rows: &Lines, columns: &Lines| {
            let pairs = rows
                .parts
                .iter()
                .flat_map(|row| columns.parts.iter().map(move |column| (row, column)));
            let spans = pairs.map(|(row, column)| Span {
                row: (row.kernel * kernel + column.kernel) * output.channels,
                shift: (row.shift * output.side + column.shift) * output.channels,
                len: output.channels,
            });
            Group {
                spans: spans.collect(),
                places: places(rows, columns, [input, output], samples),
            }
        };
        let strips = (0..kernel).flat_map(|part| {
            let rows = Lines::meeting(&by_output, part);
            let columns = by_output.iter().filter(|columns| !columns.parts.is_empty());
            let strip = |columns: &Lines| Strip {
                row: (part * kernel + columns.first()) * channels,
                len: columns.parts.len() * channels,
                places: places(&rows, columns, [output, input], samples),
            };
            columns.map(strip).collect::<Vec<_>>()
        });
        Self {
            samples,
            outputs: squared(&by_output, group),
            inputs: squared(&by_input, back),
            strips: strips.collect(),
        }
    }
}

impl Geometry {
    /// The parts of the kernel's axis that lie in the picture at an output pixel, each with its input pixel.
    fn under(self, pixel: usize) -> Vec<(usize, usize)> {
        let inside = |part: usize| {
            let input = (pixel * self.stride + part).checked_sub(self.padding)?;
            (input < self.input.side).then_some((part, input))
        };
        (0..self.kernel).filter_map(inside).collect()
    }

    /// The parts of the kernel's axis that meet an input pixel, each with its output pixel.
    fn over(self, pixel: usize) -> Vec<(usize, usize)> {
        let outputs = |part: usize| {
            let from = (pixel + self.padding).checked_sub(part)?;
            let output = from / self.stride;
            let meets = from.is_multiple_of(self.stride) && output < self.output.side;
            meets.then_some((part, output))
        };
        (0..self.kernel).filter_map(outputs).collect()
    }
}

/// Pixels of an axis that meet the same parts of the kernel's axis.
struct Lines {
    parts: Vec<Part>,
    /// Pixels, each with the first pixel that it meets.
    pixels: Vec<(usize, usize)>,
}

/// A part of the kernel's axis.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Part {
    kernel: usize,
    /// The pixel that this part meets, relative to the first pixel that any part meets.
    shift: usize,
}

impl Lines {
    fn first(&self) -> usize {
        self.parts.first().map_or(0, |part| part.kernel)
    }

    /// All pixels that meet `part` of the kernel's axis, each with the pixel that it meets.
    fn meeting(lines: &[Self], part: usize) -> Self {
        let of = |lines: &Self| {
            let part = lines.parts.iter().find(|other| other.kernel == part).copied();
            let pixels = lines.pixels.clone();
            part.map(|part| {
                pixels
                    .into_iter()
                    .map(move |(pixel, met)| (pixel, met + part.shift))
            })
        };
        let mut pixels: Vec<_> = lines.iter().filter_map(of).flatten().collect();
        pixels.sort_unstable();
        Self {
            parts: Vec::new(),
            pixels,
        }
    }
}

/// Groups the pixels of an axis by the parts that they meet.
fn axis(side: usize, met: impl Fn(usize) -> Vec<(usize, usize)>) -> Vec<Lines> {
    let mut lines: BTreeMap<Vec<Part>, Vec<(usize, usize)>> = BTreeMap::new();
    for pixel in 0..side {
        let met = met(pixel);
        let first = met.iter().map(|&(_, met)| met).min().unwrap_or(0);
        let parts = met.into_iter().map(|(kernel, met)| Part {
            kernel,
            shift: met - first,
        });
        lines.entry(parts.collect()).or_default().push((pixel, first));
    }
    let lines = lines.into_iter();
    lines.map(|(parts, pixels)| Lines { parts, pixels }).collect()
}

/// Applies `group` to every pair of rows and columns.
fn squared(axis: &[Lines], group: impl Fn(&Lines, &Lines) -> Group) -> Vec<Group> {
    let pairs = axis
        .iter()
        .flat_map(|rows| axis.iter().map(move |columns| (rows, columns)));
    pairs.map(|(rows, columns)| group(rows, columns)).collect()
}

/// The pixels of these rows and columns, in pictures of shape `own`, with the values that they meet in pictures of shape `met`.
fn places(rows: &Lines, columns: &Lines, [own, met]: [Shape; 2], samples: usize) -> Places {
    let mut places = Vec::with_capacity(samples * rows.pixels.len() * columns.pixels.len());
    for sample in 0..samples {
        for &(row, met_row) in &rows.pixels {
            for &(column, met_column) in &columns.pixels {
                let source = sample * met.len() + (met_row * met.side + met_column) * met.channels;
                places.push(Place {
                    pixel: (sample * own.pixels() + row * own.side + column) as u32,
                    source: source as u32,
                });
            }
        }
    }
    Places {
        places,
        per_sample: rows.pixels.len() * columns.pixels.len(),
    }
}
