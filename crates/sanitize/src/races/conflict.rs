//! Which accesses to a word race, and which rule they break.

use crate::cause::OpPlace;
use crate::memory_shadow::{Access, Cell};
use crate::races::class::{Class, Reach};
use crate::races::order::{AccessForm, AccessKind, Accessor, Event, Order, Ordered};
use crate::races::traits::Aliasing;
use crate::rule::{Rule, race};
use anyhit_engine::machine::Bindings;

/// The rules that two accesses can break, from what is told first to what is told last.
static RANKED: [&Rule; 13] = [
    &race::RACE_BUFFER,
    &race::RACE_WORKGROUP,
    &race::RACE_IMAGE,
    &race::RACE_MIXED_ATOMIC,
    &race::RACE_CALLER_CALLEE,
    &race::RACE_ATOMIC_WIDTH,
    &race::RACE_ATOMIC_SCOPE,
    &race::RACE_SAME_VALUE,
    &race::RACE_CROSS_REFERENCE,
    &race::RESTRICT_BROKEN,
    &race::ALIAS_DEFAULT,
    &race::ORDER_ASSUMED,
    &race::COHERENT_MISSING,
];

/// Of the races of one access the one of the least rank is told.
pub(super) fn rank(rule: &Rule) -> usize {
    RANKED.iter().position(|&ranked| ranked == rule).unwrap_or(RANKED.len())
}

impl Order {
    /// Records an access to a cell. Returns the earlier one that it races with.
    pub(super) fn access(
        &self,
        cell: &mut Cell,
        now: &Accessor,
        access: Access,
        value: u32,
    ) -> Option<(&'static Rule, Access)> {
        let kind = now.form.kind;
        if kind == AccessKind::Load && cell.loads[0] == access {
            return None;
        }
        let plain = match now.class {
            Class::Buffer => &race::RACE_BUFFER,
            Class::Workgroup => &race::RACE_WORKGROUP,
            Class::Image => &race::RACE_IMAGE,
        };
        let of_store = match kind {
            AccessKind::Load => plain,
            AccessKind::Store if cell.value == value => &race::RACE_SAME_VALUE,
            AccessKind::Store => plain,
            AccessKind::AtomicLoad | AccessKind::AtomicStore | AccessKind::AtomicUpdate => {
                &race::RACE_MIXED_ATOMIC
            }
        };
        let of_load = if kind.is_atomic() { &race::RACE_MIXED_ATOMIC } else { plain };
        let earlier = [
            (cell.store, of_store),
            (cell.loads[0], of_load),
            (cell.loads[1], of_load),
            (cell.atomic, &race::RACE_MIXED_ATOMIC),
        ];
        let found = earlier.into_iter().filter_map(|(earlier, unordered)| {
            let rule = self.broken(cell, earlier.known()?, now, unordered)?;
            Some((rule, earlier))
        });
        let found = found.min_by_key(|&(rule, _)| rank(rule));
        self.remember(cell, now, access, value);
        found
    }

    /// Keeps an access for later ones.
    fn remember(&self, cell: &mut Cell, now: &Accessor, access: Access, value: u32) {
        match now.form.kind {
            AccessKind::Load => {
                let [last, other] = cell.loads;
                // The other load is rather one of another workgroup, which no barrier orders.
                let replaces = || {
                    other.event == 0
                        || self.group(last.invocation) != now.group
                        || self.group(other.invocation) == now.group
                };
                if last.event != 0 && last.invocation != access.invocation && replaces() {
                    cell.loads[1] = last;
                }
                cell.loads[0] = access;
            }
            // Loads stay, so that `x = x + 1` in all lanes is no store of the same value.
            AccessKind::Store => (cell.store, cell.value) = (access, value),
            AccessKind::AtomicLoad | AccessKind::AtomicStore | AccessKind::AtomicUpdate => {
                let updated = |cell: &Cell| self.event(cell.atomic).form.kind.writes();
                if now.form.kind.writes() || cell.atomic.event == 0 || !updated(cell) {
                    cell.atomic = access;
                }
            }
        }
    }

    /// The rule that an earlier access and one now break together: `unordered` where nothing orders
    /// accesses of different invocations, or none.
    #[inline]
    fn broken(
        &self,
        cell: &Cell,
        earlier: Access,
        now: &Accessor,
        unordered: &'static Rule,
    ) -> Option<&'static Rule> {
        let event = self.event(earlier);
        if !(event.form.kind.writes() || now.form.kind.writes()) {
            return None;
        }
        let ordered = self.between(earlier, now);
        if ordered == Ordered::ByProgram && event.form.reference == now.form.reference {
            return None;
        }
        let atomic = match event.form.kind.is_atomic() && now.form.kind.is_atomic() {
            true => Some(self.atomics_broken(earlier, event, now)?),
            false => None,
        };
        match ordered {
            Ordered::Not => Some(atomic.unwrap_or(unordered)),
            Ordered::NotInCall => Some(atomic.unwrap_or(&race::RACE_CALLER_CALLEE)),
            Ordered::ByProgram | Ordered::BySynchronization => {
                let found = self.ordered_broken(ordered, cell, earlier, now)?;
                Some(atomic.filter(|_| found == &race::ORDER_ASSUMED).unwrap_or(found))
            }
        }
    }

    /// The rule that keeps two atomic accesses from being mutually ordered; `None` where they are.
    fn atomics_broken(&self, earlier: Access, event: &Event, now: &Accessor) -> Option<&'static Rule> {
        let [then_scope, now_scope] = [event.place, now.place].map(|place| self.traits(place).scope);
        let is_in_scope = |scope| self.is_in_scope(scope, earlier.invocation, now.invocation);
        if event.form.width != now.form.width {
            Some(&race::RACE_ATOMIC_WIDTH)
        } else if !is_in_scope(then_scope) || !is_in_scope(now_scope) {
            Some(&race::RACE_ATOMIC_SCOPE)
        } else if event.form.reference != now.form.reference {
            Some(self.aliasing_broken(event, now).unwrap_or(&race::RACE_CROSS_REFERENCE))
        } else {
            None
        }
    }

    /// The rule that accesses break although they are ordered: they go through different
    /// references, or the later one need not see the earlier one.
    fn ordered_broken(
        &self,
        ordered: Ordered,
        cell: &Cell,
        earlier: Access,
        now: &Accessor,
    ) -> Option<&'static Rule> {
        let event = self.event(earlier);
        if event.form.reference != now.form.reference {
            if let Some(rule) = self.aliasing_broken(event, now) {
                return Some(rule);
            }
            if event.form.kind.writes() {
                return Some(&race::RACE_CROSS_REFERENCE);
            }
        }
        if ordered == Ordered::ByProgram {
            return None;
        }
        let (then, own) = (self.traits(event.place), self.traits(now.place));
        if then.is_private || own.is_private {
            return Some(&race::COHERENT_MISSING);
        }
        if earlier.invocation != now.invocation && self.sync.is_exact {
            let is_seen = || {
                // An atomic instruction makes available what its invocation has written before it.
                let atomic = cell.atomic.known().filter(|atomic| {
                    let by_atomic = self.event(*atomic);
                    atomic.invocation == earlier.invocation
                        && by_atomic.form.reference == event.form.reference
                        && by_atomic.clock >= event.clock
                });
                self.is_seen(earlier, now) || atomic.is_some_and(|atomic| self.is_seen(atomic, now))
            };
            return (event.form.kind.writes() && !is_seen()).then_some(&race::ORDER_ASSUMED);
        }
        let is_wide = self.group(earlier.invocation) != now.group;
        let is_in_scope = |scope| self.is_in_scope(scope, earlier.invocation, now.invocation);
        let by_barriers = |reach: Reach| reach.across(is_wide).contains(now.class);
        let available =
            then.propagates && is_in_scope(then.scope) || by_barriers(self.barriers(event.place).available);
        let visible =
            own.propagates && is_in_scope(own.scope) || by_barriers(self.barriers(now.place).visible);
        let is_seen = available && (visible || now.form.kind.writes());
        (event.form.kind.writes() && !is_seen).then_some(&race::ORDER_ASSUMED)
    }

    /// The rule that accesses break through different declarations, unless both are `Aliased`. The
    /// elements of an array of descriptors are one declaration (SPIR-V 2.18.2 is about variables
    /// and parameters), and different references.
    fn aliasing_broken(&self, event: &Event, now: &Accessor) -> Option<&'static Rule> {
        let declaration = |place: OpPlace, handle: u32| {
            let slot = Bindings::slot_of(handle).filter(|_| handle != AccessForm::ADDRESS);
            slot.map(|(slot, _)| (place.shader, slot))
        };
        let then = declaration(event.place, event.form.handle);
        if then.is_some() && then == declaration(now.place, now.form.handle) {
            return None;
        }
        let both = [event.place, now.place].map(|place| self.traits(place).aliasing);
        match both {
            [Aliasing::Aliased, Aliasing::Aliased] => None,
            _ if both.contains(&Aliasing::Restrict) => Some(&race::RESTRICT_BROKEN),
            _ => Some(&race::ALIAS_DEFAULT),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory_shadow::MemoryKey;
    use crate::races::level::Level;
    use crate::races::ordering::Semantics;
    use crate::races::synchronization::AtomicAccess;
    use anyhit_engine::machine::{OpIndex, ShaderIndex};

    /// An order of workgroups of four invocations.
    fn order() -> Order {
        Order::of_groups(4)
    }

    /// An access of an invocation that has passed some barriers, by the operation `op`.
    fn access(
        order: &mut Order,
        cell: &mut Cell,
        (invocation, epoch): (u32, u32),
        op: u32,
        kind: AccessKind,
        value: u32,
    ) -> Option<(&'static str, u32)> {
        access_through(order, cell, (invocation, epoch), op, (kind, 0, 0), value)
    }

    /// As `access`, through a descriptor: its number and its handle.
    fn access_through(
        order: &mut Order,
        cell: &mut Cell,
        (invocation, epoch): (u32, u32),
        op: u32,
        (kind, reference, handle): (AccessKind, u32, u32),
        value: u32,
    ) -> Option<(&'static str, u32)> {
        let now = Accessor {
            invocation,
            group: order.group(invocation),
            epoch,
            barriers: 0,
            call: 0,
            class: Class::Buffer,
            place: OpPlace { shader: ShaderIndex(0), op: OpIndex(op) },
            form: AccessForm { kind, reference, handle, width: 32 },
        };
        let event = order.number(order.new_event(&now));
        let race = order.access(cell, &now, Access { invocation, event }, value);
        race.map(|(rule, other)| (rule.id, other.invocation))
    }

    use AccessKind::{AtomicLoad, AtomicUpdate, Load, Store};

    #[test]
    fn a_barrier_orders_a_workgroup_and_no_other() {
        let (order, cell) = (&mut order(), &mut Cell::default());
        assert_eq!(access(order, cell, (0, 0), 1, Store, 7), None);
        assert_eq!(access(order, cell, (0, 0), 2, Load, 0), None);
        assert_eq!(access(order, cell, (1, 1), 3, Load, 0), None);
        assert_eq!(access(order, cell, (5, 1), 3, Load, 0), Some(("race-buffer", 0)));
        // Of two loads that the store races with, the one of the other workgroup.
        assert_eq!(access(order, cell, (2, 2), 4, Store, 8), Some(("race-buffer", 5)));
        assert_eq!(access(order, cell, (3, 2), 5, Load, 0), Some(("race-buffer", 2)));
        assert_eq!(access(order, cell, (1, 3), 5, Load, 0), None);
    }

    #[test]
    fn loads_of_many_invocations_race_with_a_store_of_one_of_them() {
        let (order, cell) = (&mut order(), &mut Cell::default());
        for invocation in 0..4 {
            assert_eq!(access(order, cell, (invocation, 0), 1, Load, 0), None);
        }
        assert_eq!(access(order, cell, (3, 0), 2, Store, 1), Some(("race-buffer", 2)));
    }

    #[test]
    fn elements_of_one_array_are_one_declaration_and_different_references() {
        let order = &mut order();
        let mut found = |then: u32, now: u32| {
            let cell = &mut Cell::default();
            assert_eq!(access_through(order, cell, (0, 0), 1, (Store, 1, then), 7), None);
            access_through(order, cell, (0, 0), 2, (Load, 2, now), 0).map(|(rule, _)| rule)
        };
        let [a0, a1, b0] = [(0, 0), (0, 1), (1, 0)].map(|(slot, element)| Bindings::handle(slot, element));
        assert_eq!(found(a0, b0), Some("alias-default"));
        assert_eq!(found(a0, a1), Some("race-cross-reference"));
        assert_eq!(found(a0, AccessForm::ADDRESS), Some("alias-default"));
    }

    #[test]
    fn stores_of_one_value_are_told_apart() {
        let (order, cell) = (&mut order(), &mut Cell::default());
        assert_eq!(access(order, cell, (0, 0), 1, Store, 7), None);
        assert_eq!(access(order, cell, (1, 0), 1, Store, 7), Some(("race-same-value", 0)));
        assert_eq!(access(order, cell, (2, 0), 1, Store, 8), Some(("race-buffer", 1)));
    }

    #[test]
    fn atomic_accesses_race_with_others_alone() {
        let (order, cell) = (&mut order(), &mut Cell::default());
        assert_eq!(access(order, cell, (0, 0), 1, Store, 0), None);
        assert_eq!(access(order, cell, (1, 1), 2, AtomicUpdate, 0), None);
        assert_eq!(access(order, cell, (6, 1), 2, AtomicUpdate, 0), Some(("race-mixed-atomic", 0)));
        assert_eq!(access(order, cell, (2, 1), 3, AtomicLoad, 0), None);
        assert_eq!(access(order, cell, (3, 1), 4, Load, 0), Some(("race-mixed-atomic", 6)));
        // A load does not race with one that is atomic.
        let cell = &mut Cell::default();
        assert_eq!(access(order, cell, (0, 0), 5, Load, 0), None);
        assert_eq!(access(order, cell, (1, 0), 6, AtomicLoad, 0), None);
        assert_eq!(access(order, cell, (2, 0), 5, Load, 0), None);
        assert_eq!(access(order, cell, (2, 0), 7, Store, 0), Some(("race-buffer", 0)));
    }

    #[test]
    fn an_atomic_instruction_that_reads_what_another_has_released_orders_the_two() {
        let (order, cell) = (&mut order(), &mut Cell::default());
        assert_eq!(access(order, cell, (0, 0), 1, Store, 0), None);
        let atomic = |order: &mut Order, invocation: u32| {
            let access = AtomicAccess {
                location: (MemoryKey::Buffer(1), 0),
                class: Class::Buffer,
                reference: 1,
                width: 32,
                level: Level::Wide,
                semantics: Semantics::of(None, Level::Wide),
            };
            order.before_atomic(invocation, Some(&access), AtomicUpdate);
            order.after_atomic(invocation, Some(&access), AtomicUpdate);
            order.sync.clock += 1;
        };
        atomic(order, 0);
        assert_eq!(access(order, cell, (4, 0), 2, Load, 0), Some(("race-buffer", 0)));
        atomic(order, 4);
        // Without the Vulkan memory model, what one invocation of a workgroup acquires all do.
        assert_eq!(access(order, cell, (5, 0), 2, Load, 0), None);
    }
}
