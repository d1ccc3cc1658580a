//! Things with numbers: those of an earlier server, and new ones.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use crate::lock::lock;
use crate::problem::{Answer, Problem};

/// Things by their numbers; an id is a letter and a number, and no number is given twice.
#[derive(Debug)]
pub(super) struct Table<T> {
    letter: char,
    /// What a thing is called where it is missing.
    what: &'static str,
    rows: Mutex<Rows<T>>,
}

#[derive(Debug)]
struct Rows<T> {
    all: BTreeMap<usize, Arc<T>>,
    last: usize,
}

impl<T> Table<T> {
    pub(super) fn new(letter: char, what: &'static str) -> Self {
        let rows = Rows {
            all: BTreeMap::new(),
            last: 0,
        };
        Self {
            letter,
            what,
            rows: Mutex::new(rows),
        }
    }

    fn id(&self, number: usize) -> String {
        format!("{}{number}", self.letter)
    }

    fn number(&self, id: &str) -> Option<usize> {
        let number = id.strip_prefix(self.letter)?.parse().ok()?;
        (self.id(number) == id).then_some(number)
    }

    /// Their ids, the oldest first.
    pub(super) fn ids(&self) -> Vec<String> {
        let rows = lock(&self.rows);
        rows.all.keys().map(|&number| self.id(number)).collect()
    }

    /// One of them.
    pub(super) fn get(&self, id: &str) -> Answer<Arc<T>> {
        let number = self.number(id);
        let found = number.and_then(|number| lock(&self.rows).all.get(&number).cloned());
        found.ok_or_else(|| Problem::missing(format!("no such {}", self.what)).at(id))
    }

    /// All of them.
    pub(super) fn all(&self) -> Vec<Arc<T>> {
        lock(&self.rows).all.values().cloned().collect()
    }

    /// A new one, made with its id, unless there are `most` already.
    pub(super) fn add(
        &self,
        most: usize,
        too_many: &str,
        make: impl FnOnce(String) -> T,
    ) -> Answer<Arc<T>> {
        let mut rows = lock(&self.rows);
        if rows.all.len() >= most {
            return Err(Problem::conflict(too_many));
        }
        rows.last += 1;
        let number = rows.last;
        let made = Arc::new(make(self.id(number)));
        rows.all.insert(number, Arc::clone(&made));
        Ok(made)
    }

    /// One that has an id already; whether it is an id.
    pub(super) fn put(&self, id: &str, thing: T) -> bool {
        let Some(number) = self.number(id) else {
            return false;
        };
        let mut rows = lock(&self.rows);
        rows.last = rows.last.max(number);
        rows.all.insert(number, Arc::new(thing));
        true
    }

    /// Takes the oldest ones out until there is room for one more.
    pub(super) fn make_room(&self, most: usize) -> Vec<Arc<T>> {
        let mut rows = lock(&self.rows);
        let too_many = (rows.all.len() + 1).saturating_sub(most);
        (0..too_many)
            .filter_map(|_| rows.all.pop_first())
            .map(|(_, old)| old)
            .collect()
    }

    /// Takes one out.
    pub(super) fn remove(&self, id: &str) {
        if let Some(number) = self.number(id) {
            lock(&self.rows).all.remove(&number);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_given_once() {
        let table = Table::new('w', "work");
        assert!(table.put("w7", "seven".to_owned()));
        assert!(!table.put("w07", String::new()) && !table.put("x1", String::new()));
        table.add(3, "full", |id| id).unwrap();
        assert_eq!(table.ids(), ["w7", "w8"]);
        table.remove("w8");
        table.add(3, "full", |id| id).unwrap();
        assert_eq!(*table.get("w9").unwrap(), "w9");
        assert!(table.get("w8").is_err() && table.get("w09").is_err());
        table.add(3, "full", |id| id).unwrap();
        assert!(table.add(3, "full", |id| id).is_err());
        assert_eq!(table.make_room(3).len(), 1);
        assert_eq!(table.ids(), ["w9", "w10"]);
    }
}
