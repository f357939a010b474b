//! The cost of running a model, counted before it runs.

use super::{
    limits::{MAX_ELEMENTS, MAX_PRODUCTS, MAX_VALUE_ELEMENTS},
    value::product,
};

/// The multiplications and the memory that a model may still use per image.
pub(super) struct Budget {
    products: usize,
    elements: usize,
}

impl Budget {
    pub(super) const fn full() -> Self {
        Self {
            products: MAX_PRODUCTS,
            elements: MAX_ELEMENTS,
        }
    }

    /// Subtracts the product of `factors` from the multiplications left.
    pub(super) fn pay(&mut self, factors: &[usize]) -> Result<(), String> {
        let products = product(factors);
        self.products = self.products.checked_sub(products).ok_or_else(|| {
            format!(
                "with its {products} multiplications, the model needs more than {MAX_PRODUCTS} for an image"
            )
        })?;
        Ok(())
    }

    /// Subtracts a value of `elements` numbers per image from the memory left.
    pub(super) fn keep(&mut self, elements: usize) -> Result<(), String> {
        if elements > MAX_VALUE_ELEMENTS {
            return Err(format!(
                "it makes {elements} numbers for an image: at most {MAX_VALUE_ELEMENTS} are allowed"
            ));
        }
        self.elements = self.elements.checked_sub(elements).ok_or_else(|| {
            format!("with its {elements} numbers, the model makes more than {MAX_ELEMENTS} for an image")
        })?;
        Ok(())
    }
}
