//! Undo and redo.

use serde::{Deserialize, Serialize};

/// Steps that can be undone.
const STEPS: usize = 200;

/// What is, what was before it, and what was undone.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct History<T> {
    before: Vec<T>,
    now: T,
    undone: Vec<T>,
}

impl<T: PartialEq> History<T> {
    pub(crate) fn new(now: T) -> Self {
        Self {
            before: Vec::new(),
            now,
            undone: Vec::new(),
        }
    }

    pub(crate) fn now(&self) -> &T {
        &self.now
    }

    /// Goes on to something else; whether it is something else.
    pub(crate) fn change(&mut self, to: T) -> bool {
        if to == self.now {
            return false;
        }
        self.before.push(std::mem::replace(&mut self.now, to));
        if self.before.len() > STEPS {
            self.before.remove(0);
        }
        self.undone.clear();
        true
    }

    /// Goes back; whether there was anything.
    pub(crate) fn undo(&mut self) -> bool {
        let Some(before) = self.before.pop() else {
            return false;
        };
        self.undone.push(std::mem::replace(&mut self.now, before));
        true
    }

    /// Takes back an undo; whether there was one.
    pub(crate) fn redo(&mut self) -> bool {
        let Some(next) = self.undone.pop() else {
            return false;
        };
        self.before.push(std::mem::replace(&mut self.now, next));
        true
    }

    pub(crate) fn can_undo(&self) -> bool {
        !self.before.is_empty()
    }

    pub(crate) fn can_redo(&self) -> bool {
        !self.undone.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_back_and_forth() {
        let mut history = History::new(0);
        assert!(!history.undo() && !history.redo() && !history.change(0));
        assert!(history.change(1) && history.change(2) && history.undo() && history.undo());
        assert_eq!(
            (*history.now(), history.can_undo(), history.can_redo()),
            (0, false, true)
        );
        assert!(history.redo());
        assert!(history.change(3) && !history.can_redo());
        for step in 10..1000 {
            history.change(step);
        }
        let mut back = 0;
        while history.undo() {
            back += 1;
        }
        assert_eq!(back, STEPS);
    }
}
