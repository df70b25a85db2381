//! Executing schedules on a device.

mod ahead;
mod clock;
mod coherence;
mod copies;
mod cores;
pub mod device;
mod encode;
mod frame;
mod hierarchy;
mod host;
#[doc(hidden)]
pub mod limits;
mod memory;
mod pipelines;
mod programs;
mod readback;
#[doc(hidden)]
pub mod scene;
#[doc(hidden)]
mod session;
#[doc(hidden)]
pub mod shader;
mod shaders;
mod speculation;
#[doc(hidden)]
pub mod spirv;
mod state;
mod timing;
mod views;

pub use coherence::Reader;
pub use device::{Adapter, Gpu, GpuError};
#[cfg(not(target_arch = "wasm32"))]
pub use device::{expected_adapter, expected_device};
pub use frame::{AskPace, Frame, NodeTimes, Pace, Unfinished};
pub use host::panic_message;
#[cfg(not(target_arch = "wasm32"))]
pub use pollster::block_on;
pub use session::Session;
pub(crate) use shaders::shader_of;
pub use state::State;
