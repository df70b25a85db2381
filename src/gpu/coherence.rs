//! What host and device have of each resource: copied only when the other side reads it.

use super::copies::HostCopy;
use super::device::GpuError;
use super::encode::Pending;
use super::memory::Physical;
use super::readback::{self, Arrived};
use super::session::Session;
use crate::schedule::*;
use std::collections::HashMap;
use std::ops::Range;
use std::slice;

/// Of a resource that a host step reads.
pub(super) struct Contents {
    pub bytes: usize,
    /// None where they are among the session's copies.
    pub own: Option<HostCopy>,
}

impl Session {
    /// Contents of a buffer, or of a texture as rows without padding.
    pub async fn read(&self, resource: Resource) -> Result<Vec<u8>, GpuError> {
        self.reader().look(resource, <[u8]>::to_vec).await
    }

    /// To read one resource after the other.
    pub fn reader(&self) -> Reader<'_> {
        Reader { session: self, staging: None, contents: Vec::new() }
    }

    /// What a host step reads: bytes of each resource, and the contents of those that it shares with no other.
    pub(super) async fn read_back(&mut self, host: &Host, pending: &mut Pending) -> Result<HashMap<Resource, Contents>, GpuError> {
        let mut contents = HashMap::new();
        let mut copies = Vec::new();
        for read in &host.reads {
            let wanted = self.wanted_bytes(*read);
            let missing = self.copies.missing(read.resource, wanted);
            let is_shared = missing.is_empty() || self.shared.contains(&read.resource);
            contents.insert(read.resource, Contents { bytes: wanted, own: (!is_shared).then(HostCopy::default) });
            if !missing.is_empty() && wanted > 0 {
                self.catch_up(read.resource, pending);
                let staging = self.kept_staging(read.resource);
                copies.push((*read, self.copy_missing(pending, read.resource, &missing, &staging), missing, staging));
            }
        }
        if !copies.is_empty() {
            self.waits += 1;
            self.submit(pending);
        }
        for (read, bytes, missing, staging) in copies {
            let arrived = if bytes > 0 { Some(readback::arrive(&self.gpu, &staging, bytes).await?) } else { None };
            let own = contents.get_mut(&read.resource).and_then(|contents| contents.own.as_mut());
            let mut copies = std::mem::take(&mut self.copies);
            let copy = own.unwrap_or_else(|| copies.entry(read.resource));
            let result = copy.look(self.wanted_bytes(read), |into| self.finish_read(read.resource, arrived.as_ref(), &missing, into));
            self.copies = copies;
            result?;
        }
        Ok(contents)
    }

    /// Brings to the device what a command may look at; the host takes it for changed by the command.
    pub(super) fn catch_up_all(&mut self, command: &Command, pending: &mut Pending) {
        for resource in command.resources() {
            self.catch_up(resource, pending);
            match self.written_part(command, resource) {
                Some(range) => self.copies.fall_behind(resource, range),
                None => self.copies.invalidate(|other| other == resource),
            }
        }
    }

    /// The bytes of a resource that a command writes, where it is known to touch no others.
    fn written_part(&self, command: &Command, resource: Resource) -> Option<Range<usize>> {
        let Command::CopyToBuffer { from, to, offset } = command else { return None };
        let ResourceKind::Texture { size, format, .. } = self.schedule.resource(*from).kind else { return None };
        let bytes = (format.row_bytes(size[0]) * u64::from(size[1])) as usize;
        (*to == resource).then_some(*offset as usize..*offset as usize + bytes)
    }

    /// Brings to the device what the host alone has of a resource, after the commands so far: they may look at another that has the same memory.
    fn catch_up(&mut self, resource: Resource, pending: &mut Pending) {
        if self.copies.get(resource).is_some_and(|copy| copy.ahead().is_some()) {
            if !pending.empty {
                self.submit(pending);
            }
            self.upload_ahead(resource);
            self.copies.entry(resource).caught_up();
        }
    }

    pub(super) fn upload_ahead(&self, resource: Resource) {
        let Some((offset, bytes)) = self.copies.get(resource).and_then(HostCopy::ahead) else { return };
        match &self.physical[resource.0 as usize] {
            Physical::Buffer(buffer) => self.gpu.queue.write_buffer(buffer, offset as u64, &padded(bytes)),
            Physical::Texture { texture, format } => self.write_texture(texture, *format, bytes),
            Physical::Host | Physical::Unused => {}
        }
    }

    pub(super) fn write_texture(&self, texture: &wgpu::Texture, format: Format, rows: &[u8]) {
        let row = (texture.width() as u64 * format.bytes()) as u32;
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: Some(texture.height()) };
        self.gpu.queue.write_texture(texture.as_image_copy(), rows, layout, texture.size());
    }

    /// Bytes of a resource, rows of a texture without padding.
    pub(super) fn unpadded_bytes(&self, resource: Resource) -> usize {
        self.schedule.resource(resource).kind.bytes() as usize
    }

    fn wanted_bytes(&self, read: Read) -> usize {
        let whole = self.unpadded_bytes(read.resource);
        read.counted.map_or(whole, |(stride, count)| (stride as usize * self.variable(count) as usize).min(whole))
    }

    /// Bytes of a resource read back whole, rows of a texture padded.
    fn whole_bytes(&self, resource: Resource) -> u64 {
        match &self.physical[resource.0 as usize] {
            Physical::Texture { texture, format } => format.row_bytes(texture.width()) * texture.height() as u64 * texture.depth_or_array_layers() as u64,
            _ => self.buffer(resource).size(),
        }
    }

    /// The staging buffer that host steps read a resource through, made once.
    pub(super) fn kept_staging(&mut self, resource: Resource) -> wgpu::Buffer {
        let whole = self.whole_bytes(resource);
        let gpu = &self.gpu;
        self.staging.entry(resource).or_insert_with(|| readback::staging(gpu, whole)).clone()
    }

    /// Encodes the copy of those bytes of a buffer that are missing, one after the other, or of all of a texture; their number.
    fn copy_missing(&self, pending: &mut Pending, resource: Resource, missing: &[Range<usize>], staging: &wgpu::Buffer) -> u64 {
        let Physical::Buffer(buffer) = &self.physical[resource.0 as usize] else { return self.copy_first(pending, resource, u64::MAX, staging) };
        missing.iter().fold(0, |at, range| {
            let bytes = (range.len() as u64).next_multiple_of(4);
            pending.encoder.copy_buffer_to_buffer(buffer, range.start as u64, staging, at, bytes);
            at + bytes
        })
    }

    /// The same of the first bytes, as far as there are so many; of a texture all.
    pub(super) fn copy_first(&self, pending: &mut Pending, resource: Resource, bytes: u64, staging: &wgpu::Buffer) -> u64 {
        let whole = self.whole_bytes(resource);
        let bytes = bytes.min(whole).next_multiple_of(4);
        match &self.physical[resource.0 as usize] {
            Physical::Texture { texture, format } => {
                readback::copy_texture(&mut pending.encoder, texture, *format, staging, 0);
                return whole;
            }
            _ if bytes > 0 => pending.encoder.copy_buffer_to_buffer(self.buffer(resource), 0, staging, 0, bytes),
            _ => {}
        }
        bytes
    }

    /// Takes over what arrived of what was missing; nothing does of what is empty.
    fn finish_read(&self, resource: Resource, arrived: Option<&Arrived>, missing: &[Range<usize>], into: &mut [u8]) -> Result<(), GpuError> {
        let Some(arrived) = arrived else { return Ok(()) };
        arrived.see(&self.gpu, |mut contents| match &self.physical[resource.0 as usize] {
            Physical::Texture { texture, format } => readback::unpad(contents, texture.width(), *format, into),
            _ => {
                for range in missing {
                    into[range.clone()].copy_from_slice(&contents[..range.len()]);
                    contents = &contents[range.len().next_multiple_of(4).min(contents.len())..];
                }
            }
        })
    }
}

/// Reads resources between frames, all through the same memory.
pub struct Reader<'s> {
    session: &'s Session,
    staging: Option<wgpu::Buffer>,
    contents: Vec<u8>,
}

impl Reader<'_> {
    /// Looks at the contents of a buffer, or of a texture as rows without padding: where they lie, if they have none there.
    pub async fn look<T>(&mut self, resource: Resource, look: impl FnOnce(&[u8]) -> T) -> Result<T, GpuError> {
        self.look_first(resource, self.session.unpadded_bytes(resource), look).await
    }

    /// The same of the first bytes of a buffer, or of all of a texture.
    pub async fn look_first<T>(&mut self, resource: Resource, unpadded: usize, look: impl FnOnce(&[u8]) -> T) -> Result<T, GpuError> {
        let session = self.session;
        if let Some(known) = session.copies.get(resource).and_then(|copy| copy.known(unpadded)) {
            return Ok(look(known));
        }
        session.upload_ahead(resource);
        let whole = session.whole_bytes(resource);
        let kept = self.staging.take().filter(|staging| staging.size() >= whole);
        let staging = kept.unwrap_or_else(|| readback::staging(&session.gpu, whole));
        let mut pending = session.pending();
        let bytes = session.copy_first(&mut pending, resource, unpadded as u64, &staging);
        session.submit(&mut pending);
        let arrived = if bytes > 0 { Some(readback::arrive(&session.gpu, &staging, bytes).await?) } else { None };
        let seen = match &arrived {
            Some(arrived) if bytes == unpadded as u64 => arrived.see(&session.gpu, look)?,
            _ => {
                self.contents.resize(unpadded, 0);
                session.finish_read(resource, arrived.as_ref(), slice::from_ref(&(0..unpadded)), &mut self.contents)?;
                look(&self.contents)
            }
        };
        self.staging = Some(staging);
        Ok(seen)
    }
}

/// Writes to buffers come in fours of bytes.
fn padded(bytes: &[u8]) -> std::borrow::Cow<'_, [u8]> {
    if bytes.len().is_multiple_of(4) {
        return bytes.into();
    }
    let mut padded = bytes.to_vec();
    padded.resize(bytes.len().next_multiple_of(4), 0);
    padded.into()
}
