//! Maps in JSON whose keys are no texts: lists of pairs of key and value, for `#[serde(with)]`.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use anyhit_base::sorted::SortedMap;

/// Writes a map as a list.
///
/// # Errors
/// Those of the serializer.
pub(super) fn serialize<K: Serialize, V: Serialize, S: Serializer>(
    map: &SortedMap<K, V>,
    to: S,
) -> Result<S::Ok, S::Error> {
    to.collect_seq(map)
}

/// Reads a map that was written as a list.
///
/// # Errors
/// Those of the deserializer.
pub(super) fn deserialize<'de, K, V, D>(from: D) -> Result<SortedMap<K, V>, D::Error>
where
    K: Deserialize<'de> + Ord,
    V: Deserialize<'de>,
    D: Deserializer<'de>,
{
    Ok(Vec::<(K, V)>::deserialize(from)?.into_iter().collect())
}
