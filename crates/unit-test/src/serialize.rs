//! Results for serde. Buffers and images are left out: they are read by name or binding, as
//! [`Value`](crate::value::Value)s or bytes.

use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use crate::trace::Traced;

/// The closest hit (nothing for a miss), the payload, counts and printed lines.
impl Serialize for Traced {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut fields = to.serialize_struct("Traced", 4)?;
        fields.serialize_field("hit", &(!self.missed()).then(|| self.hit()))?;
        fields.serialize_field("payload", &self.payload)?;
        fields.serialize_field("stats", &self.stats)?;
        fields.serialize_field("printed", &self.printed)?;
        fields.end()
    }
}
