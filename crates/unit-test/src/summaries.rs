//! `Debug` of data with a shader's type: values by the names of members, not bytes.

use std::fmt;

use crate::data::TypedBytes;
use crate::struct_data::StructData;

impl fmt::Debug for StructData {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "StructData({} bytes, {:?})", self.bytes().len(), self.value())
    }
}

impl fmt::Debug for TypedBytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "TypedBytes({:?})", self.value())
    }
}
