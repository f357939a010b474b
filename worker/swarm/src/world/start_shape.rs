//! Where the robots of a world start.

use crate::{Invalid, counted, invalid, text};
use murmuration_proto::v1;
use std::sync::Arc;

const UNIFORM: &str = "uniform";
const DISC: &str = "disc";
const LINE: &str = "line";
const POSES: &str = "poses";

/// Where the robots of a world start. Headings are uniform in \[0, 2 pi), except those of poses.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum StartShape {
    /// Uniform in the whole world, as in the paper.
    #[default]
    Uniform,
    /// Uniform in a disc about the centre of the world.
    Disc {
        /// Radius of the disc, world units, over 0 and at most half the smaller side of the world.
        radius: f64,
    },
    /// Evenly spaced on a horizontal line about the centre of the world, the first robot leftmost. A single robot starts in the
    /// centre.
    Line {
        /// Distance of the last robot from the first, world units, 0 to the width of the world.
        length: f64,
    },
    /// (x, y, theta) of each robot, world units and radians, the same for every seed. x and y are in the world; theta is at most
    /// [`StartShape::MAX_ANGLE`] in magnitude.
    Poses(Arc<[[f64; 3]]>),
}

impl StartShape {
    /// Largest magnitude of a heading, radians.
    pub const MAX_ANGLE: f64 = 1000.0;

    /// The start shape of a message, for this number of agents in a world of this width and height.
    pub(super) fn in_world(message: v1::StartShape, agents: u32, sides: [f64; 2]) -> Result<Self, Invalid> {
        let shape = message.shape.as_deref().unwrap_or(UNIFORM);
        let absent = |field: &str, is_given: bool, of: &str| match is_given && shape != of {
            true => Err(Invalid::new(
                field,
                "given",
                format!("absent: shape is not \"{of}\""),
            )),
            false => Ok(()),
        };
        absent("radius", message.radius.is_some(), DISC)?;
        absent("length", message.length.is_some(), LINE)?;
        absent("poses", !message.poses.is_empty(), POSES)?;
        let needed = |field: &str, value: Option<f64>| {
            value.ok_or_else(|| Invalid::missing(field, format!("given: shape is \"{shape}\"")))
        };
        match shape {
            UNIFORM => Ok(Self::Uniform),
            DISC => {
                let radius = needed("radius", message.radius)?;
                let most = sides[0].min(sides[1]) / 2.0;
                invalid::positive("radius", radius, most).map(|radius| Self::Disc { radius })
            }
            LINE => {
                let length = needed("length", message.length)?;
                invalid::real("length", length, 0.0..=sides[0]).map(|length| Self::Line { length })
            }
            POSES => poses(&message.poses, agents, sides).map(Self::Poses),
            other => {
                let allowed = [UNIFORM, DISC, LINE, POSES].map(|name| format!("\"{name}\""));
                Err(Invalid::new("shape", text::quoted(other), allowed.join(" or ")))
            }
        }
    }
}

/// Reads the poses of `agents` agents from one list with the numbers of all poses.
fn poses(numbers: &[f64], agents: u32, [width, height]: [f64; 2]) -> Result<Arc<[[f64; 3]]>, Invalid> {
    let (poses, rest) = numbers.as_chunks::<3>();
    if !rest.is_empty() || poses.len() != agents as usize {
        let given = match rest {
            [] => counted(poses.len() as u64, "pose"),
            _ => counted(numbers.len() as u64, "number"),
        };
        let allowed = format!(
            "{}, one for each agent: [x, y, theta]",
            counted(agents.into(), "pose")
        );
        return Err(Invalid::new("poses", given, allowed));
    }
    let most = [
        0.0..=width,
        0.0..=height,
        -StartShape::MAX_ANGLE..=StartShape::MAX_ANGLE,
    ];
    for (i, pose) in poses.iter().enumerate() {
        for (part, (value, most)) in pose.iter().zip(&most).enumerate() {
            invalid::real(&format!("poses[{i}][{part}]"), *value, most.clone())?;
        }
    }
    Ok(poses.into())
}

impl From<&StartShape> for v1::StartShape {
    fn from(shape: &StartShape) -> Self {
        let (name, radius, length, poses) = match shape {
            StartShape::Uniform => (UNIFORM, None, None, Vec::new()),
            StartShape::Disc { radius } => (DISC, Some(*radius), None, Vec::new()),
            StartShape::Line { length } => (LINE, None, Some(*length), Vec::new()),
            StartShape::Poses(poses) => (POSES, None, None, poses.as_flattened().to_vec()),
        };
        Self {
            shape: Some(name.to_owned()),
            radius,
            length,
            poses,
        }
    }
}
