//! Bytes that come through a pipe, whose wait can be stopped.

use crate::progress::Progress;
use std::io::{Error, ErrorKind, Read, Result};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

/// Bytes that are read at once, and how many such blocks wait to be used.
const BLOCK: usize = 1 << 20;
const BLOCKS: usize = 4;
/// Longest wait between two looks at the stop flag.
const LOOK: Duration = Duration::from_millis(20);

/// What another thread reads. That thread is left alone when it waits for bytes that nobody wants any more.
pub(super) struct Piped {
    blocks: Receiver<Result<Vec<u8>>>,
    block: Vec<u8>,
    used: usize,
    stop: Arc<Progress>,
}

impl Piped {
    pub(super) fn new(mut input: Box<dyn Read + Send>, stop: Arc<Progress>) -> Self {
        let (sender, blocks) = sync_channel(BLOCKS);
        std::thread::spawn(move || {
            loop {
                let mut block = vec![0; BLOCK];
                let read = match input.read(&mut block) {
                    Ok(0) => return,
                    Ok(read) => {
                        block.truncate(read);
                        Ok(block)
                    }
                    Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                    Err(error) => Err(error),
                };
                let failed = read.is_err();
                if sender.send(read).is_err() || failed {
                    return;
                }
            }
        });
        Self { blocks, block: Vec::new(), used: 0, stop }
    }

    /// Whether the wait was stopped.
    pub(super) fn stopped(&self) -> bool {
        self.stop.stopped()
    }
}

impl Read for Piped {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        while self.used == self.block.len() {
            match self.blocks.recv_timeout(LOOK) {
                Ok(block) => (self.block, self.used) = (block?, 0),
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
                Err(RecvTimeoutError::Timeout) if self.stop.stopped() => {
                    return Err(Error::other("stopped"));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
        let rest = &self.block[self.used..];
        let count = rest.len().min(bytes.len());
        bytes[..count].copy_from_slice(&rest[..count]);
        self.used += count;
        Ok(count)
    }
}
