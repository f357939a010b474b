//! A macro for validated records: private fields, one documented getter each.

/// Declares a struct whose fields can be read but not written from outside its module.
macro_rules! record {
    (
        $(#[$outer:meta])*
        pub struct $name:ident { $( $(#[$doc:meta])* $field:ident : $type:ty, )+ }
    ) => {
        $(#[$outer])*
        pub struct $name { $( $field: $type, )+ }

        impl $name {
            $( $(#[$doc])* #[must_use] pub const fn $field(&self) -> $type { self.$field } )+
        }
    };
}

pub(crate) use record;
