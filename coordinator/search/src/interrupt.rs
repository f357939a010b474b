//! Interrupts long computations.
//!
//! Pure functions that may take long receive an [`Interrupt`] and check it in their loops. The module does not depend on threads
//! or tasks, or on the code that raises an interrupt.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

/// A flag that ends the computations that check it. Clones share the flag.
#[derive(Debug, Clone, Default)]
pub struct Interrupt {
    raised: Arc<AtomicBool>,
    /// A parent flag that, when raised, also ends the computations.
    parent: Option<Arc<Self>>,
}

/// A computation was interrupted before it had a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the computation was interrupted: the coordinator stops, or nobody needs the result any more")]
pub struct Interrupted;

impl Interrupt {
    /// A separate flag that also counts as raised when this flag is raised.
    #[must_use]
    pub fn child(&self) -> Self {
        Self {
            raised: Arc::default(),
            parent: Some(Arc::new(self.clone())),
        }
    }

    /// Ends every computation that checks this flag or a child of it, now and later.
    pub fn raise(&self) {
        self.raised.store(true, Ordering::Relaxed);
    }

    /// Fails if the computation must end.
    ///
    /// # Errors
    /// [`Interrupted`] once this flag or its parent is raised.
    pub fn check(&self) -> Result<(), Interrupted> {
        if self.raised.load(Ordering::Relaxed) {
            return Err(Interrupted);
        }
        match &self.parent {
            Some(parent) => parent.check(),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flag_ends_its_children_and_not_its_parent() {
        let all = Interrupt::default();
        let [one, other] = [all.child(), all.child()];
        one.clone().raise();
        assert_eq!(
            [&all, &one, &other].map(Interrupt::check),
            [Ok(()), Err(Interrupted), Ok(())]
        );
        all.raise();
        assert_eq!(other.check(), Err(Interrupted));
    }
}
