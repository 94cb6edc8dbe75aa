//! Shader calls: which shader has called which, by which trace, call or report (Vulkan, Memory
//! Model, "Shader Call Order").

/// The calls of a launch so far.
#[derive(Debug, Default)]
pub(super) struct Calls {
    /// By number; the first stands for all where calls are not followed.
    calls: Vec<Call>,
}

/// A shader that runs for some invocations.
#[derive(Clone, Copy, Debug, Default)]
struct Call {
    /// The call of the shader that has called it; itself for one that nobody has called.
    parent: u32,
    /// How often the caller had stopped then.
    at_stop: u32,
    /// How many callers there are above.
    depth: u32,
    /// How often it has stopped so far.
    stops: u32,
}

/// How two calls of one launch index are related.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kinship {
    /// One instruction has called both, or shaders that have called them: they have no order.
    Siblings,
    /// One has called the other, or instructions that follow each other have.
    InOrder,
}

impl Calls {
    /// Calls that are told apart.
    pub(super) fn followed() -> Self {
        Self { calls: vec![Call::default()] }
    }

    /// A shader begins, which another one has called or nobody. Returns the number of its call.
    pub(super) fn begin(&mut self, caller: Option<u32>) -> u32 {
        if self.calls.is_empty() {
            return 0;
        }
        let number = self.calls.len() as u32;
        let call = match caller {
            None => Call { parent: number, ..Call::default() },
            Some(caller) => {
                let Call { stops, depth, .. } = self.calls[caller as usize];
                Call { parent: caller, at_stop: stops, depth: depth + 1, stops: 0 }
            }
        };
        self.calls.push(call);
        number
    }

    /// The shader of a call hands its batch to the pipeline.
    pub(super) fn stop(&mut self, call: u32) {
        if let Some(call) = self.calls.get_mut(call as usize) {
            call.stops += 1;
        }
    }

    /// How two different calls are related.
    pub(super) fn kinship(&self, one: u32, other: u32) -> Kinship {
        let call = |number: u32| self.calls[number as usize];
        let (mut one, mut other) = (one, other);
        loop {
            let (a, b) = (call(one), call(other));
            if a.depth != b.depth {
                let deeper = if a.depth > b.depth { &mut one } else { &mut other };
                *deeper = call(*deeper).parent;
                if one == other {
                    return Kinship::InOrder;
                }
                continue;
            }
            if a.parent == b.parent {
                return if a.at_stop == b.at_stop { Kinship::Siblings } else { Kinship::InOrder };
            }
            if a.depth == 0 {
                return Kinship::InOrder;
            }
            (one, other) = (a.parent, b.parent);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shaders_of_one_trace_are_siblings_and_those_of_the_next_follow_them() {
        let mut calls = Calls::followed();
        let ray_generation = calls.begin(None);
        calls.stop(ray_generation);
        let [any_hit, closest_hit] = [(); 2].map(|()| calls.begin(Some(ray_generation)));
        calls.stop(closest_hit);
        let callable = calls.begin(Some(closest_hit));
        calls.stop(ray_generation);
        let second = calls.begin(Some(ray_generation));
        assert_eq!(calls.kinship(any_hit, closest_hit), Kinship::Siblings);
        assert_eq!(calls.kinship(callable, any_hit), Kinship::Siblings);
        assert_eq!(calls.kinship(callable, ray_generation), Kinship::InOrder);
        assert_eq!(calls.kinship(any_hit, second), Kinship::InOrder);
        assert_eq!(calls.kinship(second, callable), Kinship::InOrder);
    }

    #[test]
    fn calls_that_are_not_followed_are_all_one() {
        let mut calls = Calls::default();
        assert_eq!([calls.begin(None), calls.begin(Some(0))], [0, 0]);
        calls.stop(0);
    }
}
