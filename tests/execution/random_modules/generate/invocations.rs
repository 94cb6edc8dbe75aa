//! What invocations do together: atomic and subgroup instructions, barriers.

use rspirv::spirv::{GroupOperation, Op, StorageClass};

use super::super::generate::{Generator, Place, SHARED};
use super::super::module::{Id, Operand, Ty};

impl Generator {
    /// An atomic instruction on a word that all invocations change alike: the order does not show.
    pub(super) fn shared_atomic(&mut self) {
        const OPS: [Op; SHARED] = [
            Op::AtomicIAdd,
            Op::AtomicAnd,
            Op::AtomicOr,
            Op::AtomicXor,
            Op::AtomicUMin,
            Op::AtomicUMax,
            Op::AtomicSMin,
            Op::AtomicSMax,
        ];
        self.count("shared atomic");
        let at = self.random.below(SHARED);
        let pointer = self.module.pointer(StorageClass::StorageBuffer, Ty(1));
        let (zero, index, device) = (self.word(0), self.word(at as u32), self.word(1));
        let place = self.hidden(Op::AccessChain, pointer, &[self.shared, zero, index].map(Operand::Id));
        let value = self.value(Ty(1), 1);
        let op = match (at, self.random.below(3)) {
            (0, 1) => Op::AtomicISub,
            _ => OPS[at],
        };
        self.hidden(op, Ty(1), &[place, device, zero, value].map(Operand::Id));
    }

    /// An atomic instruction on a word of the invocation's own.
    pub(super) fn own_atomic(&mut self) {
        let ints: Vec<Ty> = self
            .scalars
            .iter()
            .copied()
            .filter(|&ty| self.module.is_int(ty) && self.module.width(ty) >= 32)
            .collect();
        let ty = self.random.pick(&ints);
        let shared = |place: &Place| !matches!(place.class, StorageClass::Function | StorageClass::Private);
        let Some((place, path)) = self.place_of(ty, &shared) else { return };
        self.count("own atomic");
        let pointer = self.chain(place, &path);
        let (zero, device) = (self.word(0), self.word(1));
        let (a, b) = (self.value(ty, 1), self.value(ty, 1));
        match self.random.below(6) {
            0 => {
                self.effect(Op::AtomicStore, [pointer, device, zero, a].map(Operand::Id).to_vec());
            }
            1 => drop(self.inst(Op::AtomicLoad, ty, &[pointer, device, zero])),
            2 => drop(self.inst(Op::AtomicCompareExchange, ty, &[pointer, device, zero, zero, a, b])),
            3 => {
                let op = self.random.pick(&[Op::AtomicIIncrement, Op::AtomicIDecrement]);
                self.inst(op, ty, &[pointer, device, zero]);
            }
            _ => {
                let op = self.random.pick(&[
                    Op::AtomicExchange,
                    Op::AtomicIAdd,
                    Op::AtomicISub,
                    Op::AtomicSMin,
                    Op::AtomicUMin,
                    Op::AtomicSMax,
                    Op::AtomicUMax,
                    Op::AtomicAnd,
                    Op::AtomicOr,
                    Op::AtomicXor,
                ]);
                self.inst(op, ty, &[pointer, device, zero, a]);
            }
        }
    }

    /// Members of a subgroup that is whole, or of the workgroup where that is smaller.
    pub(super) fn members(&self) -> u32 {
        self.subgroup.min(self.module.local_size)
    }

    pub(super) fn subgroup_instruction(&mut self) {
        self.count("subgroup instruction");
        let scope = self.word(3);
        let members = self.members();
        let count = self.random.pick(&[1, 1, 2, 4]);
        let int = self.index_ty();
        let ints = self.module.vector(int, count);
        match self.random.below(10) {
            0 => {
                let value = self.value(Ty(2), 2);
                let uvec4 = self.module.vector(Ty(1), 4);
                let ballot = self.inst(Op::GroupNonUniformBallot, uvec4, &[scope, value]);
                match self.random.below(3) {
                    0 => {
                        let operation = self.random.pick(&[
                            GroupOperation::Reduce,
                            GroupOperation::InclusiveScan,
                            GroupOperation::ExclusiveScan,
                        ]);
                        let operands =
                            [Operand::Id(scope), Operand::Literal(operation as u32), Operand::Id(ballot)];
                        let id = self.hidden(Op::GroupNonUniformBallotBitCount, Ty(1), &operands);
                        self.know(Ty(1), id);
                    }
                    1 => drop(self.inst(Op::GroupNonUniformInverseBallot, Ty(2), &[scope, ballot])),
                    _ => {
                        let index = self.lane(members);
                        self.inst(Op::GroupNonUniformBallotBitExtract, Ty(2), &[scope, ballot, index]);
                    }
                }
            }
            1 => {
                let value = self.value(Ty(2), 2);
                let op = self.random.pick(&[Op::GroupNonUniformAll, Op::GroupNonUniformAny]);
                self.inst(op, Ty(2), &[scope, value]);
            }
            2 => {
                let value = self.value(ints, 1);
                self.inst(Op::GroupNonUniformAllEqual, Ty(2), &[scope, value]);
                self.inst(Op::GroupNonUniformElect, Ty(2), &[scope]);
            }
            3 => {
                let of = self.draw_scalar();
                let ty = self.module.vector(of, count);
                let value = self.value(ty, 2);
                if self.random.chance(1, 2) {
                    self.inst(Op::GroupNonUniformBroadcastFirst, ty, &[scope, value]);
                } else {
                    let from = self.random.below(members as usize) as u32;
                    let from = self.word(from);
                    self.inst(Op::GroupNonUniformBroadcast, ty, &[scope, value, from]);
                }
            }
            4 => {
                let of = self.draw_scalar();
                let ty = self.module.vector(of, count);
                let value = self.value(ty, 2);
                let index = self.lane(members);
                self.inst(Op::GroupNonUniformShuffle, ty, &[scope, value, index]);
            }
            5 => {
                let of = self.draw_scalar();
                let ty = self.module.vector(of, count);
                let value = self.value(ty, 2);
                let mask = self.random.below(members as usize) as u32;
                let mask = self.word(mask);
                self.inst(Op::GroupNonUniformShuffleXor, ty, &[scope, value, mask]);
            }
            6 => {
                // The lowest ones get nothing that is defined, and do not look at it.
                let value = self.value(int, 2);
                let delta = 1 + self.random.below(2) as u32;
                let delta = self.word(delta);
                let up =
                    self.hidden(Op::GroupNonUniformShuffleUp, int, &[scope, value, delta].map(Operand::Id));
                let lane = self.hidden(Op::Load, Ty(1), &[Operand::Id(self.lane_id)]);
                let has = self.inst(Op::UGreaterThanEqual, Ty(2), &[lane, delta]);
                self.inst(Op::Select, int, &[has, up, value]);
            }
            _ => {
                let op = self.random.pick(&[
                    Op::GroupNonUniformIAdd,
                    Op::GroupNonUniformIMul,
                    Op::GroupNonUniformUMin,
                    Op::GroupNonUniformUMax,
                    Op::GroupNonUniformSMin,
                    Op::GroupNonUniformSMax,
                    Op::GroupNonUniformBitwiseAnd,
                    Op::GroupNonUniformBitwiseOr,
                    Op::GroupNonUniformBitwiseXor,
                ]);
                let operation = self.random.pick(&[
                    GroupOperation::Reduce,
                    GroupOperation::InclusiveScan,
                    GroupOperation::ExclusiveScan,
                ]);
                // `UMin` and `UMax` are for unsigned integers.
                let width = self.module.width(int);
                let unsigned = self.module.int(width, false);
                let of = if matches!(op, Op::GroupNonUniformUMin | Op::GroupNonUniformUMax) {
                    unsigned
                } else {
                    int
                };
                let ty = self.module.vector(of, count);
                let value = self.value(ty, 2);
                let operands = [Operand::Id(scope), Operand::Literal(operation as u32), Operand::Id(value)];
                let id = self.hidden(op, ty, &operands);
                self.know(ty, id);
            }
        }
    }

    pub(super) fn index_ty(&mut self) -> Ty {
        let ints: Vec<Ty> = self.scalars.iter().copied().filter(|&ty| self.module.is_int(ty)).collect();
        self.random.pick(&ints)
    }

    /// The number of an invocation of the subgroup.
    pub(super) fn lane(&mut self, members: u32) -> Id {
        let value = self.value(Ty(1), 1);
        let members = self.word(members);
        self.inst(Op::UMod, Ty(1), &[value, members])
    }

    /// A barrier, a look at another invocation's element, a barrier.
    pub(super) fn exchange(&mut self) {
        if self.workgroup.is_empty() {
            return self.store();
        }
        self.count("barrier");
        let (variable, element) = self.random.pick(&self.workgroup);
        let (workgroup, semantics) = (self.word(2), self.word(0x108));
        let barrier = [workgroup, workgroup, semantics].map(Operand::Id).to_vec();
        // Which element that is, is drawn before the barriers: this may call functions, which
        // store.
        let value = if self.random.chance(1, 2) { self.local_index } else { self.value(Ty(1), 1) };
        let (step, size) = (self.random.below(4) as u32, self.module.local_size);
        let (step, size) = (self.word(step), self.word(size));
        let sum = self.inst(Op::IAdd, Ty(1), &[value, step]);
        let index = self.inst(Op::UMod, Ty(1), &[sum, size]);
        let pointer = self.module.pointer(StorageClass::Workgroup, element);
        let other = self.inst(Op::AccessChain, pointer, &[variable, index]);
        let place = Place { id: other, class: StorageClass::Workgroup, to: element, object: variable };
        let paths = self.module.paths(element, &|_| true);
        let path = paths[self.random.below(paths.len())].clone();
        let ty = self.module.at_path(element, &path);
        let pointer = self.chain(place, &path);
        self.effect(Op::ControlBarrier, barrier.clone());
        self.load(pointer, place.class, ty);
        self.effect(Op::ControlBarrier, barrier);
    }
}
