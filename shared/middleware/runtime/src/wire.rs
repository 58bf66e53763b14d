//! Makes messages fit for shared memory.

use iceoryx2::prelude::ZeroCopySend;
use kerbside_messages::layout::Described;
use kerbside_messages::{Message, TrajectoryPoint};

/// A message as iceoryx2 transports it: the same bytes, with a type name that carries the layouts' version.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Wire<M>(pub(crate) M);

// SAFETY: a `Message` is `Pod`: `repr(C)`, self-contained, without pointers, padding or invalid bit patterns; and
// `Wire` is transparent. The type name holds the version of the layouts, which changes whenever one of them does.
unsafe impl<M: Message> ZeroCopySend for Wire<M> {
    unsafe fn type_name() -> &'static str {
        M::TYPE_NAME
    }
}

/// A point of a plan as iceoryx2 transports it.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WirePoint(pub(crate) TrajectoryPoint);

// SAFETY: as for `Wire`: `TrajectoryPoint` is `Pod`.
unsafe impl ZeroCopySend for WirePoint {
    unsafe fn type_name() -> &'static str {
        TrajectoryPoint::TYPE_NAME
    }
}

/// The points behind their transparent wrapper.
pub(crate) fn points(wired: &[WirePoint]) -> &[TrajectoryPoint] {
    const { assert!(size_of::<WirePoint>() == size_of::<TrajectoryPoint>()) };
    const { assert!(TrajectoryPoint::LAYOUT.size == size_of::<TrajectoryPoint>()) };
    // SAFETY: `WirePoint` is `repr(transparent)` over `TrajectoryPoint`, so slices of both have one layout.
    unsafe { core::slice::from_raw_parts(wired.as_ptr().cast(), wired.len()) }
}

/// Points as they are transported; the way back from [`points`].
pub(crate) fn wired(points: &[TrajectoryPoint]) -> &[WirePoint] {
    // SAFETY: as for `points`: `WirePoint` is `repr(transparent)` over `TrajectoryPoint`.
    unsafe { core::slice::from_raw_parts(points.as_ptr().cast(), points.len()) }
}
