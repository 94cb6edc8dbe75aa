//! Ray queries: a traversal each, and what its shader may do with it next (Vulkan, "Ray Queries").
//!
//! A variable of type `OpTypeRayQueryKHR` is one register that holds a handle: 0 until the query is
//! initialised, then its place in the batch's [`RayQueries`], from 1 on. So arrays of queries,
//! pointers to them and divergence need no special handling, and a copy of the batch copies its
//! queries.

use std::sync::Arc;

use crate::accel::{
    Candidate, Committed, Cursor, HitKind, HitPrimitive, InstanceVerdict, LookAhead, PrimitiveVerdict,
    RayFlags, Tlas, TraceRay, TraversalObserver,
};
use crate::geometry::Ray;
use crate::machine::index::OpIndex;
use crate::machine::object::ObjectPool;
use crate::machine::open_choices::OpenChoices;
use crate::machine::trap::TrapCode;

/// The phase of a query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Its variable was declared again since it was initialised.
    Uninitialized,
    /// Initialised, and each `OpRayQueryProceedKHR` so far returned true.
    Underway,
    /// `OpRayQueryTerminateKHR` was executed: the next `OpRayQueryProceedKHR` returns false.
    Terminated,
    /// `OpRayQueryProceedKHR` returned false.
    Complete,
}

/// A ray query. Uses that the specification leaves undefined give a [`TrapCode`].
#[derive(Clone, Debug)]
pub struct RayQuery {
    tlas: Arc<Tlas>,
    cursor: Cursor,
    phase: Phase,
    /// What the last `OpRayQueryProceedKHR` came to, where that returned true. It stays readable
    /// after it was confirmed, when the cursor has nothing to decide any more.
    candidate: Option<Candidate>,
    /// The lane that initialised it last.
    lane: u32,
    /// What an observer noted of it.
    pub notes: QueryNotes,
}

/// What an observer of a shader notes of a query; nothing else reads or writes it.
#[derive(Clone, Copy, Debug, Default)]
pub struct QueryNotes {
    /// The first use of the committed hit since the last `OpRayQueryProceedKHR`, where that was not
    /// final.
    pub early_use: Option<OpIndex>,
    /// The `OpRayQueryProceedKHR` whose result is ignored, while nothing looked at its candidate.
    pub ignored: Option<OpIndex>,
    /// The first use of the committed hit, its t apart, while there is a candidate.
    pub committed_use: Option<OpIndex>,
    /// Whether that candidate was looked at.
    pub candidate_used: bool,
    /// The first `OpRayQueryProceedKHR` since the query was initialised that came to a candidate.
    pub undecided: Option<OpIndex>,
    /// Whether any candidate since then was looked at, confirmed or generated in.
    pub decides: bool,
}

/// A query that is not initialised.
impl Default for RayQuery {
    fn default() -> Self {
        let ray = Ray { t_max: 0.0, ..Ray::new([0.0; 3], [0.0; 3]) };
        let trace = TraceRay { ray, flags: RayFlags(0), cull_mask: 0, time: 0.0 };
        let tlas = Tlas::empty().clone();
        let cursor = Cursor::new(&tlas, trace);
        Self {
            cursor,
            tlas,
            phase: Phase::Uninitialized,
            candidate: None,
            lane: 0,
            notes: QueryNotes::default(),
        }
    }
}

impl RayQuery {
    /// `OpRayQueryInitializeKHR`: discards the old state and reuses its memory.
    fn initialize(&mut self, tlas: &Arc<Tlas>, trace: TraceRay) {
        // All threads share the reference count of a structure: it is not touched needlessly.
        if !Arc::ptr_eq(&self.tlas, tlas) {
            self.tlas = tlas.clone();
        }
        self.cursor.reset(tlas, trace);
        self.phase = Phase::Underway;
        self.candidate = None;
    }

    /// `OpRayQueryProceedKHR`: whether there is a candidate to decide on.
    ///
    /// # Errors
    /// `RayQueryComplete` after it returned false.
    #[inline]
    pub fn proceed(&mut self, observer: &mut impl TraversalObserver) -> Result<bool, TrapCode> {
        self.candidate = match self.phase {
            Phase::Underway => self.cursor.proceed_observed(&self.tlas, observer),
            Phase::Terminated => None,
            Phase::Complete => return Err(TrapCode::RayQueryComplete),
            Phase::Uninitialized => return Err(TrapCode::RayQueryUninitialized),
        };
        if self.candidate.is_none() {
            self.phase = Phase::Complete;
        }
        Ok(self.candidate.is_some())
    }

    /// `OpRayQueryTerminateKHR`
    pub fn terminate(&mut self) {
        if self.phase == Phase::Underway {
            self.phase = Phase::Terminated;
        }
    }

    /// `OpRayQueryConfirmIntersectionKHR`
    ///
    /// # Errors
    /// `RayQueryNoCandidate`, or `RayQueryNotTriangle` for a box.
    pub fn confirm(&mut self) -> Result<(), TrapCode> {
        if self.candidate()?.is_box() {
            return Err(TrapCode::RayQueryNotTriangle);
        }
        // A second time changes nothing.
        self.cursor.confirm();
        Ok(())
    }

    /// `OpRayQueryGenerateIntersectionKHR`
    ///
    /// # Errors
    /// `RayQueryNoCandidate`, `RayQueryNotAabb`, `RayQueryMotion` in a structure with motion
    /// (VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06354), and `RayQueryOutsideInterval`
    /// for a t before `t_min` or behind the committed hit (06353).
    pub fn generate(&mut self, t: f32) -> Result<(), TrapCode> {
        if !self.candidate()?.is_box() {
            return Err(TrapCode::RayQueryNotAabb);
        }
        if self.tlas.moves() {
            return Err(TrapCode::RayQueryMotion);
        }
        if !(t >= self.cursor.trace().ray.t_min && t <= self.cursor.t_max()) {
            return Err(TrapCode::RayQueryOutsideInterval);
        }
        self.cursor.generate(t, HitKind(0));
        Ok(())
    }

    /// The current candidate.
    ///
    /// # Errors
    /// `RayQueryNoCandidate` where the last `OpRayQueryProceedKHR` did not return true.
    #[inline]
    pub fn candidate(&self) -> Result<&Candidate, TrapCode> {
        self.candidate.as_ref().ok_or(TrapCode::RayQueryNoCandidate)
    }

    /// Whether `OpRayQueryProceedKHR` returned false.
    pub fn is_complete(&self) -> bool {
        self.phase == Phase::Complete
    }

    /// Whether `OpRayQueryProceedKHR` may come to further candidates.
    pub fn is_underway(&self) -> bool {
        self.phase == Phase::Underway
    }

    /// The lane that initialised it last.
    pub fn lane(&self) -> usize {
        self.lane as usize
    }

    /// The committed hit, where there is one.
    #[inline]
    pub fn committed(&self) -> Option<&Committed> {
        self.cursor.committed()
    }

    /// Ray, flags and cull mask.
    #[inline]
    pub fn trace(&self) -> &TraceRay {
        self.cursor.trace()
    }

    /// The acceleration structure.
    #[inline]
    pub fn tlas(&self) -> &Arc<Tlas> {
        &self.tlas
    }
}

/// A step of a ray query, with the query and the operation that made it.
#[derive(Clone, Debug)]
pub struct RayQueryEvent {
    /// The query's handle.
    pub query: u32,
    /// The lane of the batch that initialised the query.
    pub lane: u32,
    /// The operation of the program.
    pub op: OpIndex,
    /// The step.
    pub step: RayQueryStep,
}

/// A step of a ray query. The steps of its traversal come before the instruction's result.
#[derive(Clone, Debug)]
pub enum RayQueryStep {
    /// `OpRayQueryInitializeKHR`
    Initialize(Arc<Tlas>, TraceRay),
    /// A node was visited: of the BVH of an instance's BLAS, or (`None`) of the TLAS.
    Node(Option<u32>),
    /// Traversal reached an instance.
    Instance(u32, InstanceVerdict),
    /// Traversal tested a primitive.
    Primitive(HitPrimitive, PrimitiveVerdict),
    /// `OpRayQueryProceedKHR` came to a candidate, or (`None`) returned false.
    Proceed(Option<Candidate>),
    /// `OpRayQueryConfirmIntersectionKHR`
    Confirm,
    /// `OpRayQueryGenerateIntersectionKHR` at this t.
    Generate(f32),
    /// `OpRayQueryTerminateKHR`
    Terminate,
    /// The hit that is committed from now on.
    Commit(Committed),
}

/// Records the steps of a traversal as events of a ray query.
struct QueryRecorder<'a> {
    query: u32,
    lane: u32,
    op: OpIndex,
    traversal: bool,
    events: &'a mut Vec<RayQueryEvent>,
}

impl QueryRecorder<'_> {
    fn record(&mut self, step: RayQueryStep) {
        self.events.push(RayQueryEvent { query: self.query, lane: self.lane, op: self.op, step });
    }
}

impl TraversalObserver for QueryRecorder<'_> {
    fn explains_misses(&self) -> bool {
        self.traversal
    }

    fn node(&mut self, instance: Option<u32>) {
        if self.traversal {
            self.record(RayQueryStep::Node(instance));
        }
    }

    fn instance(&mut self, instance: u32, verdict: InstanceVerdict) {
        if self.traversal {
            self.record(RayQueryStep::Instance(instance, verdict));
        }
    }

    fn primitive(&mut self, primitive: HitPrimitive, verdict: PrimitiveVerdict) {
        if self.traversal {
            self.record(RayQueryStep::Primitive(primitive, verdict));
        }
    }

    fn commit(&mut self, committed: &Committed) {
        self.record(RayQueryStep::Commit(*committed));
    }
}

/// The ray queries of a batch.
#[derive(Clone, Debug, Default)]
pub struct RayQueries {
    all: ObjectPool<RayQuery>,
    look_ahead: LookAhead,
    /// How many `OpRayQueryInitializeKHR` were executed, counted by lanes.
    pub initialized: u64,
    /// How many of them had a direction of zero.
    pub zero_directions: u64,
    /// The events of the queries, where they are recorded.
    pub events: Option<Vec<RayQueryEvent>>,
    /// Whether nodes, instances and primitives are recorded, too.
    pub records_traversal: bool,
}

impl RayQueries {
    /// Discards all queries; their memory stays allocated.
    pub fn clear(&mut self) {
        self.all.clear();
        (self.initialized, self.zero_directions) = (0, 0);
    }

    /// `OpRayQueryInitializeKHR` of a lane, of the query with a handle, or of a new one where that
    /// is 0. Returns its handle.
    pub fn initialize(
        &mut self,
        handle: u32,
        lane: u32,
        op: OpIndex,
        tlas: &Arc<Tlas>,
        trace: TraceRay,
    ) -> u32 {
        self.initialized += 1;
        self.zero_directions += u64::from(trace.ray.goes_nowhere());
        let (query, object) = self.all.get_or_insert(handle);
        object.initialize(tlas, trace);
        if handle == 0 {
            object.notes = QueryNotes::default();
        }
        object.lane = lane;
        if let Some(events) = &mut self.events {
            let step = RayQueryStep::Initialize(tlas.clone(), trace);
            events.push(RayQueryEvent { query, lane, op, step });
        }
        query
    }

    /// Draws what is open about the traversal of a query that was just initialised.
    #[cold]
    pub fn draw(&mut self, handle: u32, op: OpIndex, choices: &OpenChoices, launch_id: [u32; 3]) {
        if let Some(RayQuery { cursor, tlas, .. }) = self.all.get_mut(handle) {
            choices.draw_traversal(launch_id, Some(op), tlas, cursor);
        }
    }

    /// Makes a query uninitialized, as its variable is declared again.
    pub fn uninitialize(&mut self, handle: u32) {
        if let Some(query) = self.all.get_mut(handle) {
            query.phase = Phase::Uninitialized;
        }
    }

    /// The query with a handle.
    ///
    /// # Errors
    /// `RayQueryUninitialized`
    #[inline]
    pub fn query(&mut self, handle: u32) -> Result<&mut RayQuery, TrapCode> {
        let query = self.all.get_mut(handle).filter(|query| query.phase != Phase::Uninitialized);
        query.ok_or(TrapCode::RayQueryUninitialized)
    }

    /// The query with a handle, as it is; `None` where it is not initialised.
    pub fn get(&self, handle: u32) -> Option<&RayQuery> {
        self.all.get(handle).filter(|query| query.phase != Phase::Uninitialized)
    }

    /// All queries that were initialised.
    pub fn iter(&self) -> impl Iterator<Item = &RayQuery> {
        self.all.iter()
    }

    /// Finds together what the queries with some handles, which proceed next, come to; as far as
    /// that pays.
    pub fn look_ahead(&mut self, handles: &[u32]) {
        let Self { all, look_ahead, events, .. } = self;
        let Some(first) = handles.first().and_then(|&handle| all.get(handle)) else { return };
        if events.is_some() || !look_ahead.begin(&first.tlas, handles.len()) {
            return;
        }
        for &handle in handles {
            if let Some(query) = all.get(handle).filter(|query| query.phase == Phase::Underway) {
                look_ahead.add(handle, &query.cursor, &query.tlas);
            }
        }
        look_ahead.find(|handle, hit| {
            if let Some(query) = all.get_mut(handle) {
                query.cursor.take_next_hit(hit);
            }
        });
    }

    /// [`RayQuery::proceed`]
    ///
    /// # Errors
    /// Those of [`RayQuery::proceed`].
    #[inline]
    pub fn proceed(&mut self, handle: u32, op: OpIndex) -> Result<bool, TrapCode> {
        let Some(mut events) = self.events.take() else { return self.query(handle)?.proceed(&mut ()) };
        let lane = self.lane(handle);
        let traversal = self.records_traversal;
        let mut recorder = QueryRecorder { query: handle, lane, op, traversal, events: &mut events };
        let done = self.query(handle).and_then(|query| {
            let more = query.proceed(&mut recorder)?;
            recorder.record(RayQueryStep::Proceed(query.candidate));
            Ok(more)
        });
        self.events = Some(events);
        done
    }

    /// [`RayQuery::terminate`]
    ///
    /// # Errors
    /// `RayQueryUninitialized`
    pub fn terminate(&mut self, handle: u32, op: OpIndex) -> Result<(), TrapCode> {
        self.query(handle)?.terminate();
        self.record(handle, op, RayQueryStep::Terminate);
        Ok(())
    }

    /// [`RayQuery::confirm`]
    ///
    /// # Errors
    /// Those of [`RayQuery::confirm`].
    pub fn confirm(&mut self, handle: u32, op: OpIndex) -> Result<(), TrapCode> {
        self.query(handle)?.confirm()?;
        self.record(handle, op, RayQueryStep::Confirm);
        Ok(())
    }

    /// [`RayQuery::generate`]
    ///
    /// # Errors
    /// Those of [`RayQuery::generate`].
    pub fn generate(&mut self, handle: u32, op: OpIndex, t: f32) -> Result<(), TrapCode> {
        self.query(handle)?.generate(t)?;
        self.record(handle, op, RayQueryStep::Generate(t));
        Ok(())
    }

    /// Records a decision, and the hit that is committed after it.
    fn record(&mut self, query: u32, op: OpIndex, step: RayQueryStep) {
        let committed = self.all.get(query).and_then(|query| query.committed().copied());
        let lane = self.lane(query);
        if let Some(events) = &mut self.events {
            let event = |step| RayQueryEvent { query, lane, op, step };
            events.push(event(step));
            events.extend(committed.map(|hit| event(RayQueryStep::Commit(hit))));
        }
    }

    /// The lane that initialised a query.
    fn lane(&self, handle: u32) -> u32 {
        self.all.get(handle).map_or(0, |query| query.lane)
    }
}
