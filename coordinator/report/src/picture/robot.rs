//! A robot from above: its body, and the range of its sensors.

use maud::{Markup, html};
use murmuration_model::colours;
use murmuration_swarm::{Robot, Seen, SeenRobots, Sensor};
use std::f64::consts::PI;

/// Half of a drawing's side, in units of the drawing.
const HALF: f64 = 120.0;
/// Drawn length of a sensor with unlimited range, and of the longest sensor with a limited range.
const LONGEST: f64 = 104.0;
/// Minimum radius of a drawn body, so that every body is visible.
const SMALLEST_BODY: f64 = 7.0;

/// A drawing (SVG) of a robot that heads to the right; positive angles turn clockwise, as in the pictures of swarms. `angles` has
/// the direction of each sensor; with `None`, free sensors are drawn in their possible directions.
///
/// Lengths are to scale, with two exceptions: a very small body is enlarged, and a sensor with unlimited range reaches the edge.
pub fn robot_svg(robot: &Robot, angles: Option<&[f64]>) -> Markup {
    let ranges = robot.sensors().iter().filter_map(sensor_reach);
    let longest = ranges.fold(10.0 * robot.radius(), f64::max);
    let scale = LONGEST / longest;
    let body = (robot.radius() * scale).max(SMALLEST_BODY);
    let view = format!("{} {} {} {}", -HALF, -HALF, 2.0 * HALF, 2.0 * HALF);
    html! {
        svg.robot xmlns="http://www.w3.org/2000/svg" viewBox=(view) role="img" font-family="sans-serif" font-size="11"
            aria-label={ "A robot with " (robot.sensors().len()) " sensors" } {
            @for (i, sensor) in robot.sensors().iter().enumerate() {
                (drawn_sensor(i, sensor, angles.and_then(|angles| angles.get(i).copied()), scale))
            }
            circle r=(short(body)) fill="#f4f2ec" stroke="#3c3b37" stroke-width="1.5" {}
            line x2=(short(body)) stroke="#3c3b37" stroke-width="1.5" {}
        }
    }
}

/// Maximum distance at which a sensor sees robots, walls or obstacles, in world units; `None` if its range is unlimited.
pub fn sensor_reach(sensor: &Sensor) -> Option<f64> {
    let robots = match sensor.robots() {
        SeenRobots::None if !sensor.sees_obstacles() => Some(0.0),
        _ => sensor.range(),
    };
    Some(robots?.max(sensor.wall_range().unwrap_or(0.0)))
}

fn drawn_sensor(i: usize, sensor: &Sensor, chosen: Option<f64>, scale: f64) -> Markup {
    let colour = colours::hex(colours::AGENTS[i]);
    let length = sensor_reach(sensor).map_or(LONGEST, |reach| reach * scale);
    let free = sensor.angle();
    let middles = match (free.value().or(chosen), free.range()) {
        (Some(angle), _) => vec![angle],
        // A free sensor is drawn beside the middle of its range, because another sensor is often in the middle.
        (None, Some([low, high])) => vec![low + 0.75 * (high - low)],
        (None, None) => free.choices().to_vec(),
    };
    let label = at(middles[0], 0.75 * length + 10.0);
    html! {
        g fill="none" stroke=(colour) stroke-width="1.5" {
            @for &middle in &middles {
                path d=(cone(middle, sensor.half_angle(), length)) fill=(colour) fill-opacity="0.16"
                    stroke-dasharray=[sensor_reach(sensor).is_none().then_some("5 4")] {}
            }
            @if let (None, Some([low, high])) = (chosen, free.range()) {
                path d=(arc(low, high, 0.55 * length)) stroke-dasharray="2 4" {}
            }
            text x=(short(label[0])) y=(short(label[1] + 4.0)) fill=(colour) stroke="none" text-anchor="middle" font-weight="bold" {
                "S" (i + 1)
                @if *sensor.robots() == SeenRobots::None { @if sensor.sees_obstacles() { " obstacles" } @else { " walls" } }
            }
        }
    }
}

/// The outline of a cone, or a line if the cone has no width.
fn cone(middle: f64, half: f64, length: f64) -> String {
    if half == 0.0 {
        let [x, y] = at(middle, length);
        return format!("M0 0L{} {}", short(x), short(y));
    }
    if half >= PI {
        let r = short(length);
        return format!("M-{r} 0A{r} {r} 0 1 1 {r} 0A{r} {r} 0 1 1 -{r} 0Z");
    }
    let arc = arc(middle - half, middle + half, length);
    format!("M0 0L{}Z", &arc[1..])
}

fn arc(from: f64, to: f64, radius: f64) -> String {
    let ([x, y], [to_x, to_y]) = (at(from, radius), at(to, radius));
    let large = u8::from(to - from > PI);
    let [x, y, to_x, to_y, r] = [x, y, to_x, to_y, radius].map(short);
    format!("M{x} {y}A{r} {r} 0 {large} 1 {to_x} {to_y}")
}

fn at(angle: f64, distance: f64) -> [f64; 2] {
    [distance * angle.cos(), distance * angle.sin()]
}

/// Rounds a length to two decimals.
fn short(length: f64) -> f64 {
    (100.0 * length).round() / 100.0 + 0.0
}

/// A sensor in words, such as `a cone 0.4 rad wide at 1.57 rad that sees walls up to 40`.
pub fn sensor_in_words(sensor: &Sensor, angle: Option<f64>) -> String {
    let shape = match sensor.half_angle() {
        0.0 => "a ray".to_owned(),
        half if half >= PI => "all around".to_owned(),
        half => format!("a cone {} rad wide", rounded(2.0 * half)),
    };
    let free = sensor.angle();
    let direction = match (free.value().or(angle), free.range()) {
        (Some(0.0), _) => "straight ahead".to_owned(),
        (Some(angle), _) => format!("at {} rad", rounded(angle)),
        (None, Some([low, high])) => format!("anywhere from {} to {} rad", rounded(low), rounded(high)),
        (None, None) => format!("at one of {} angles", free.choices().len()),
    };
    let limit = |range: Option<f64>| match range {
        Some(range) => format!(" up to {}", rounded(range)),
        None => " at any distance".to_owned(),
    };
    let robots = match sensor.robots() {
        SeenRobots::None => None,
        SeenRobots::All => Some(format!("robots{}", limit(sensor.range()))),
        SeenRobots::Species(name) => Some(format!(
            "{}{}",
            Seen::Species(name.clone()),
            limit(sensor.range())
        )),
    };
    let walls = sensor
        .wall_range()
        .map(|range| format!("walls{}", limit(Some(range))));
    let obstacles = sensor
        .sees_obstacles()
        .then(|| format!("obstacles{}", limit(sensor.range())));
    let sees: Vec<_> = [robots, walls, obstacles].into_iter().flatten().collect();
    format!("{shape} {direction} that sees {}", sees.join(" and "))
}

fn rounded(number: f64) -> f64 {
    (1e4 * number).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::{CampaignSpec, Preset};

    fn robot(sensors: &str) -> Robot {
        let text = format!("[robot]\nsensors = [{sensors}]");
        let (model, _) = CampaignSpec::robots_from_toml(&text).unwrap();
        model.species()[0].robot().clone()
    }

    #[test]
    fn sensors_read_well() {
        let words = |sensor: &str| sensor_in_words(&robot(sensor).sensors()[0], None);
        assert_eq!(
            words("{}"),
            "a ray straight ahead that sees robots at any distance"
        );
        assert_eq!(
            words(
                "{ angle = 1.57, half_angle = 0.2, range = 120, wall_range = 40, sees = [\"robots\", \"walls\"] }"
            ),
            "a cone 0.4 rad wide at 1.57 rad that sees robots up to 120 and walls up to 40"
        );
        assert_eq!(
            words("{ angle = \"free\", angle_range = [-1, 1], half_angle = 3.141592653589793 }"),
            "all around anywhere from -1 to 1 rad that sees robots at any distance"
        );
    }

    #[test]
    fn a_drawing_has_every_sensor_within_its_frame() {
        let several = robot(
            "{}, { angle = \"free\", angles = [1.0, 2.0], range = 50 }, { half_angle = 3.1, sees = [\"walls\"], range = 40 }",
        );
        for robot in [several, Preset::TwoSensor.robot(), Preset::Flockbots.robot()] {
            let drawn = robot_svg(&robot, None).into_string();
            for sensor in 1..=robot.sensors().len() {
                assert!(drawn.contains(&format!(">S{sensor}")), "{drawn}");
            }
            let (_, paths) = drawn.split_once("aria-label").unwrap();
            let numbers = paths
                .split(['"', ' ', 'L', 'A', 'M', 'Z'])
                .filter_map(|text| text.parse::<f64>().ok());
            assert!(numbers.into_iter().all(|number| number.abs() <= HALF), "{drawn}");
        }
    }
}
