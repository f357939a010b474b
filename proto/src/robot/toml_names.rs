//! Fields of robots whose form in files differs from the messages'.

/// `angle = 0.5` or `angle = "free"`.
pub(crate) mod angle {
    use crate::v1::SensorAngle;
    use serde::{
        Deserializer, Serializer,
        de::{Error, Unexpected, Visitor},
    };
    use std::fmt;

    const FREE: &str = "free";

    pub(crate) fn serialize<S: Serializer>(
        angle: &Option<SensorAngle>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        match angle.as_ref().and_then(|angle| angle.fixed) {
            Some(fixed) => serializer.serialize_f64(fixed),
            None => serializer.serialize_str(FREE),
        }
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<SensorAngle>, D::Error> {
        deserializer.deserialize_any(Angle).map(Some)
    }

    struct Angle;

    impl Visitor<'_> for Angle {
        type Value = SensorAngle;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a number of radians, or \"free\"")
        }

        fn visit_f64<E: Error>(self, fixed: f64) -> Result<SensorAngle, E> {
            Ok(SensorAngle { fixed: Some(fixed) })
        }

        fn visit_i64<E: Error>(self, fixed: i64) -> Result<SensorAngle, E> {
            self.visit_f64(fixed as f64)
        }

        fn visit_str<E: Error>(self, text: &str) -> Result<SensorAngle, E> {
            match text {
                FREE => Ok(SensorAngle { fixed: None }),
                _ => Err(E::invalid_value(Unexpected::Str(text), &self)),
            }
        }
    }
}

/// `ratios = [[12, 12], [8, 16]]`.
pub(crate) mod ratios {
    use crate::v1::Ratio;
    use serde::{Deserialize as _, Deserializer, Serializer};

    pub(crate) fn serialize<S: Serializer>(ratios: &[Ratio], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(ratios.iter().map(|ratio| &ratio.counts))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Ratio>, D::Error> {
        let ratios = Vec::<Vec<u32>>::deserialize(deserializer)?;
        Ok(ratios.into_iter().map(|counts| Ratio { counts }).collect())
    }
}
