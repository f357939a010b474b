//! What running a model may cost, counted before it runs.

use super::{
    limits::{MAX_ELEMENTS, MAX_PRODUCTS, MAX_VALUE_ELEMENTS},
    shape::product,
};

/// What is left of the multiplications and of the memory that a model may take for an image.
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

    /// Pays for as many multiplications as the product of `factors`.
    pub(super) fn pay(&mut self, factors: &[usize]) -> Result<(), String> {
        let products = product(factors);
        self.products = self.products.checked_sub(products).ok_or_else(|| {
            format!("with its {products} multiplications the model takes over {MAX_PRODUCTS} for an image")
        })?;
        Ok(())
    }

    /// Pays for keeping a value of so many numbers for each image.
    pub(super) fn keep(&mut self, elements: usize) -> Result<(), String> {
        if elements > MAX_VALUE_ELEMENTS {
            return Err(format!("it makes {elements} numbers for an image"));
        }
        self.elements = self.elements.checked_sub(elements).ok_or_else(|| {
            format!("with its {elements} numbers the model makes over {MAX_ELEMENTS} for an image")
        })?;
        Ok(())
    }
}
