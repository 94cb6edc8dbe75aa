//! Exponents of measured costs: how a cost grows with a size.

/// Allowed growth of a cost with the size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Growth {
    /// Independent of the size.
    Constant,
    /// In proportion to the logarithm of the size.
    Logarithmic,
    /// In proportion to the size, apart from a fixed cost.
    Linear,
}

impl Growth {
    /// The largest accepted exponent.
    pub fn limit(self) -> f64 {
        match self {
            Self::Constant => 0.15,
            Self::Logarithmic => 0.5,
            Self::Linear => 1.15,
        }
    }

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Logarithmic => "logarithmic",
            Self::Linear => "linear",
        }
    }
}

/// Returns the exponent of a linear cost with a large fixed part, which would lower the slope: that
/// of the growth since the smallest size, by the growth of the size. It is 1 for a + b n, whatever
/// a is.
///
/// A growth below a quarter of the smallest cost is not distinct from noise and is omitted; if
/// fewer than two points remain, the exponent is the slope of the costs themselves.
pub fn exponent_above_fixed_cost(points: &[(f64, f64)]) -> f64 {
    let [(size, cost), rest @ ..] = points else { return 0.0 };
    let grown = rest.iter().map(|(n, c)| (n - size, c - cost));
    let grown: Vec<_> = grown.filter(|(_, growth)| *growth > 0.25 * cost.max(1e-9)).collect();
    if grown.len() > 1 { slope(&grown) } else { slope(points) }
}

/// Returns the exponent of peaks of memory, of which those below twice a floor are not those of the
/// work; 0 if fewer than two remain.
pub fn exponent_of_peaks(points: &[(f64, f64)], floor: f64) -> f64 {
    let high: Vec<_> = points.iter().copied().filter(|(_, bytes)| *bytes > 2.0 * floor).collect();
    if high.len() > 1 { slope(&high) } else { 0.0 }
}

/// Returns the slope of the line that is nearest to the logarithms of the points (least squares).
/// Costs of 0 count as the smallest positive cost of 1e-9.
pub fn slope(points: &[(f64, f64)]) -> f64 {
    let logarithms = || points.iter().map(|(n, c)| (n.ln(), c.max(1e-9).ln()));
    let count = points.len().max(1) as f64;
    let (x, y) = logarithms().fold((0.0, 0.0), |(x, y), (n, c)| (x + n / count, y + c / count));
    let (product, square) =
        logarithms().fold((0.0, 0.0), |(p, s), (n, c)| (p + (n - x) * (c - y), s + (n - x) * (n - x)));
    if square > 0.0 { product / square } else { 0.0 }
}
