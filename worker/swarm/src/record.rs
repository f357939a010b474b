//! A macro for validated records, whose private fields have one documented getter each.

/// Declares a struct whose fields can be read but not written from outside its module. Getters return copies, or, for fields
/// under `by reference`, a reference to the type after `as`.
macro_rules! record {
    (
        $(#[$outer:meta])*
        pub struct $name:ident { $( $(#[$doc:meta])* $field:ident : $type:ty, )+ }
        $( by reference { $( $(#[$large_doc:meta])* $large:ident : $large_type:ty as $target:ty, )+ } )?
    ) => {
        $(#[$outer])*
        pub struct $name { $( $field: $type, )+ $( $( $large: $large_type, )+ )? }

        impl $name {
            $( $(#[$doc])* #[must_use] pub const fn $field(&self) -> $type { self.$field } )+
            $( $( $(#[$large_doc])* #[must_use] pub fn $large(&self) -> &$target { &self.$large } )+ )?
        }
    };
}

pub(crate) use record;
