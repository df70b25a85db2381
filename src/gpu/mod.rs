//! Executing recordings on a device.

mod ahead;
mod clock;
mod copies;
pub mod device;
pub mod execution;
mod hierarchy;
pub mod limits;
mod pipelines;
mod programs;
mod readback;
pub mod scene;
pub mod shader;
mod shaders;
pub mod spirv;
mod timing;

pub use device::{Adapter, Gpu, GpuError, expected_device};
pub use execution::{AskPace, Frame, NodeTimes, Pace, Reader, Session, Unfinished};
