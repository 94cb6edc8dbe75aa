//! Objects of JSON, member by member.

use serde_json::{Map, Value};

/// An object of so many members. Of two with one name the last one stays.
///
/// `Map::from_iter` would sort them first, and be compiled with a sort for each iterator.
pub fn json_object(members: impl Iterator<Item = (String, Value)>) -> Value {
    let mut object = Map::new();
    for (name, value) in members {
        object.insert(name, value);
    }
    Value::Object(object)
}
