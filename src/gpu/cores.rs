//! Work with the device on all cores of the host; in a browser, whose devices belong to one thread, on that one.

use super::device::{Gpu, GpuError};

#[cfg(not(target_arch = "wasm32"))]
pub use rayon::join;

/// Makes something of each item. Each thread tells what the driver says to it.
#[cfg(not(target_arch = "wasm32"))]
pub fn each<I, T, All>(gpu: &Gpu, doing: &str, items: I, make: impl Fn(I::Item) -> Result<T, GpuError> + Sync) -> Result<All, GpuError>
where
    I: rayon::iter::IntoParallelIterator,
    T: Send,
    All: rayon::iter::FromParallelIterator<T>,
{
    use rayon::iter::ParallelIterator;
    items.into_par_iter().map(|item| super::block_on(gpu.told(doing, async { make(item) }))).collect()
}

#[cfg(target_arch = "wasm32")]
pub fn join<A, B>(a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
    (a(), b())
}

/// Makes something of each item. What the browser says is told to whoever waits for all of it.
#[cfg(target_arch = "wasm32")]
pub fn each<I, T, All>(_: &Gpu, _: &str, items: I, make: impl Fn(I::Item) -> Result<T, GpuError>) -> Result<All, GpuError>
where
    I: IntoIterator,
    All: FromIterator<T>,
{
    items.into_iter().map(make).collect()
}
