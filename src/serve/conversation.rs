//! One client's talk with the server: read within limits of size and time, and answered.

use super::clients::{Client, FRAMES, REFUSED, Request, Shared};
use super::slmsuite::{Command, answer, description, hardware};
use super::stream::Stream;
use super::task::{Done, Task};
use super::{FrameRequest, SentFrame, slmpy, slmsuite, trigger};
use std::io::{self, ErrorKind, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

/// Bytes read at once.
const CHUNK: usize = 64 * 1024;
/// How many whole requests' worth of bytes may be held at once, over all clients.
const HELD_REQUESTS: usize = 4;
/// What a client is told when too many frames are being read at once.
const BUSY: &str = "The server is busy with other frames.";
/// How often it is looked whether the client of a long task is still there.
const LOOK: Duration = Duration::from_millis(20);
/// A request may take this many times the patience in all, however steadily it drips.
const WHOLE_REQUEST: u32 = 6;

/// One client's talk with the server.
pub(super) struct Conversation<'a> {
    pub(super) shared: &'a Shared,
    client: &'a Client,
    stream: Stream,
    /// Its address and number, for the log.
    who: String,
    /// Whether the connection outlives its frames.
    lasting: bool,
    /// Bytes of it that are held, of the server's budget.
    held: usize,
}

impl<'a> Conversation<'a> {
    pub(super) fn new(shared: &'a Shared, client: &'a Client, stream: Stream) -> Self {
        let who = format!("{} client {}", stream.peer(), client.number);
        Self { shared, client, stream, who, lasting: true, held: 0 }
    }

    /// Writes into the log what came of a request.
    pub(super) fn told(&self, what: &str, came: &str) {
        self.shared.log.line(&self.who, what, came);
    }

    /// The same, of a frame or another request.
    pub(super) fn told_outcome(&self, what: &str, outcome: &Result<Option<Done>, String>) {
        match outcome {
            Ok(Some(Done::Played(flips))) => {
                let last = flips.last().map_or(0, |flip| flip.number);
                self.told(what, &format!("played {} frames to frame {last}", flips.len()));
            }
            Ok(Some(Done::Shown(flip))) => self.told(what, &format!("shown as frame {}", flip.number)),
            Ok(Some(Done::Kept(_)) | None) => self.told(what, "answered"),
            Err(why) => self.told(what, &format!("refused: {why}")),
        }
    }

    /// Counts a request that cannot be served, and writes why.
    pub(super) fn refuse(&self, what: &str, why: &str) {
        self.shared.count(REFUSED);
        self.told(what, &format!("refused: {why}"));
    }

    /// One line in, one line out.
    pub(super) fn slmsuite(&mut self) -> io::Result<()> {
        self.lasting = false;
        let panel = &self.shared.panel;
        let line = match self.line(slmsuite::request_limit(panel), None) {
            Ok(line) => line,
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Err(error),
            Err(error) => {
                self.refuse("slmsuite", &error.to_string());
                return self.reply(answer(Err(error.to_string())).as_bytes());
            }
        };
        let command = slmsuite::read(&line, panel, self.shared.calibrated);
        drop(line);
        self.release();
        let outcome = match command {
            Ok(Command::Ping) => Ok(hardware(panel)),
            Ok(Command::Describe) => Ok(description(panel, self.shared.calibrated)),
            Ok(Command::Wait) => Ok(serde_json::Value::Null),
            Ok(Command::Show(frame)) => {
                let shown = self.show(frame).map(Some);
                self.told_outcome("slmsuite frame", &shown);
                shown.map(|_| serde_json::Value::Null)
            }
            Err(why) => {
                self.refuse("slmsuite", &why);
                Err(why)
            }
        };
        self.reply(answer(outcome).as_bytes())
    }

    /// Frame after frame, until the client goes or sends what has no end that can be found.
    pub(super) fn slmpy(&mut self) -> io::Result<()> {
        let limit = slmpy::frame_limit(&self.shared.panel);
        loop {
            let mut head = [0; 4];
            // Between frames a client may be silent for as long as it likes.
            self.stream.set_read_timeout(None)?;
            self.stream.read_exact(&mut head[..1])?;
            self.whole(&mut head[1..], Instant::now())?;
            let length = i32::from_le_bytes(head);
            let Some(length) = usize::try_from(length).ok().filter(|length| (1..=limit).contains(length)) else {
                self.refuse("slmpy", "no length of a frame of this panel");
                return self.reply(slmpy::ERR);
            };
            let mut sent = Vec::new();
            let start = Instant::now();
            while sent.len() < length {
                let had = sent.len();
                // Memory grows with what has come, not with what was promised.
                sent.resize((had + CHUNK).min(length), 0);
                let room = self.wait_for_room(sent.len() - had, limit).map_err(io::Error::other);
                if let Err(error) = room.and_then(|()| self.whole(&mut sent[had..], start)) {
                    self.refuse("slmpy frame", &error.to_string());
                    let _ = self.reply(slmpy::ERR);
                    return Err(error);
                }
            }
            let read = slmpy::read(&sent, &self.shared.panel);
            drop(sent);
            self.release();
            let shown =
                read.inspect_err(|_| _ = self.shared.count(REFUSED)).and_then(|frame| self.show(frame).map(Some));
            // The protocol's answer has no room for the reason.
            self.told_outcome("slmpy frame", &shown);
            self.reply(if shown.is_ok() { slmpy::DONE } else { slmpy::ERR })?;
        }
    }

    /// Lines of text, each of which shows a frame that is kept ready.
    pub(super) fn trigger(&mut self) -> io::Result<()> {
        // Whose the frame is that a trigger shows, it does not say.
        self.lasting = false;
        let (mut came, mut chunk) = (Vec::new(), [0; trigger::LINE_LIMIT]);
        loop {
            while let Some(end) = came.iter().position(|&byte| byte == b'\n') {
                let line: Vec<u8> = came.drain(..=end).collect();
                let asked = trigger::read(&line[..end]).inspect_err(|_| _ = self.shared.count(REFUSED));
                let outcome = asked.and_then(|task| self.ask(task, SentFrame::default())).map(Some);
                self.told_outcome("trigger", &outcome);
                let said = match &outcome {
                    Ok(done) => done.as_ref().and_then(Done::last).ok_or("nothing was shown"),
                    Err(why) => Err(why.as_str()),
                };
                self.reply(trigger::answer(said).as_bytes())?;
            }
            if came.len() > trigger::LINE_LIMIT {
                self.refuse("trigger", "the line is longer than a name");
                return self.reply(trigger::answer(Err("the line is longer than a name")).as_bytes());
            }
            // Between lines a client may be silent for as long as it likes.
            self.stream.set_read_timeout(None)?;
            match self.stream.read(&mut chunk)? {
                0 => return Err(io::Error::new(ErrorKind::UnexpectedEof, "The client has gone.")),
                read => came.extend_from_slice(&chunk[..read]),
            }
        }
    }

    /// Hands a frame on and waits until it is on the panel.
    fn show(&mut self, frame: SentFrame) -> Result<Done, String> {
        self.ask(Task::Show, frame)
    }

    /// Hands a task on and waits until it is done, and the panel has settled where that was asked for.
    pub(super) fn ask(&mut self, task: Task, frame: SentFrame) -> Result<Done, String> {
        self.client.answering.store(true, Ordering::SeqCst);
        let (answer, shown) = sync_channel(1);
        if matches!(task, Task::Show | Task::Recall(_) | Task::Next | Task::Play { .. }) {
            self.shared.count(FRAMES);
        }
        let abandoned = Arc::new(AtomicBool::new(false));
        let (limit, is_long) = (self.shared.patience + task.lasts(), !task.lasts().is_zero());
        let request = FrameRequest {
            task,
            frame,
            arrived: Instant::now(),
            client: self.lasting.then_some(self.client.number),
            answer,
            abandoned: Arc::clone(&abandoned),
        };
        let sent = self.shared.frames.send(request).map_err(|_| "The panel is no longer served.".to_owned());
        let outcome = sent.and_then(|()| {
            let begin = Instant::now();
            let answer = loop {
                let left = limit.saturating_sub(begin.elapsed());
                match shown.recv_timeout(if is_long { LOOK.min(left) } else { left }) {
                    Err(RecvTimeoutError::Timeout) if !left.is_zero() && is_long => {
                        if self.has_gone() {
                            abandoned.store(true, Ordering::SeqCst);
                        }
                    }
                    answer => break answer,
                }
            };
            answer.unwrap_or_else(|_| {
                abandoned.store(true, Ordering::SeqCst);
                Err("The panel did not show the frame in time.".into())
            })
        });
        if let Some(flip) = outcome.as_ref().ok().and_then(Done::last) {
            self.client.proven.store(true, Ordering::SeqCst);
            // Here and not at the panel: others may have theirs shown meanwhile.
            std::thread::sleep(self.shared.settle.saturating_sub(flip.at.elapsed()));
        }
        self.client.answering.store(false, Ordering::SeqCst);
        outcome
    }

    /// Whether the client went while it was waiting for an answer. One that sends something meanwhile has no use for the answer, either.
    fn has_gone(&mut self) -> bool {
        // A timeout of zero would be none.
        let looked = self.stream.set_read_timeout(Some(Duration::from_millis(1)));
        match looked.and_then(|()| self.stream.read(&mut [0])) {
            Ok(_) => true,
            Err(error) => !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted),
        }
    }

    pub(super) fn reply(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)?;
        self.stream.flush()
    }

    /// Reads up to the first line feed, which is left out. `first`: a byte of it that was read already.
    ///
    /// What has come behind the line feed is lost: clients wait for the answer before they send more.
    pub(super) fn line(&mut self, limit: usize, first: Option<u8>) -> io::Result<Vec<u8>> {
        let start = Instant::now();
        let (mut line, mut chunk) = (Vec::new(), vec![0; CHUNK.min(limit)]);
        match first {
            Some(b'\n') => return Ok(line),
            Some(byte) => line.push(byte),
            None => {}
        }
        loop {
            let read = self.some(&mut chunk, start)?;
            let (part, ended) = match chunk[..read].iter().position(|&byte| byte == b'\n') {
                Some(end) => (&chunk[..end], true),
                None => (&chunk[..read], false),
            };
            if line.len() + part.len() > limit {
                return Err(io::Error::new(
                    ErrorKind::InvalidData,
                    "The request is longer than a frame of this panel.",
                ));
            }
            let room = self.wait_for_room(part.len(), limit);
            room.map_err(|why| io::Error::new(ErrorKind::OutOfMemory, why))?;
            line.extend_from_slice(part);
            if ended {
                return Ok(line);
            }
        }
    }

    /// The first byte of a request: between requests a client may be silent for as long as it likes.
    pub(super) fn wait_for_first(&mut self, first: &mut [u8; 1]) -> io::Result<()> {
        self.stream.set_read_timeout(None)?;
        self.stream.read_exact(first)
    }

    /// Fills `buffer` whole.
    pub(super) fn whole(&mut self, buffer: &mut [u8], start: Instant) -> io::Result<()> {
        let mut filled = 0;
        while filled < buffer.len() {
            filled += self.some(&mut buffer[filled..], start)?;
        }
        Ok(())
    }

    /// Reads what has come, at least a byte; fails when the client is silent too long or the request of `start` is too old.
    fn some(&mut self, buffer: &mut [u8], start: Instant) -> io::Result<usize> {
        let patience = self.shared.patience;
        let left = (patience * WHOLE_REQUEST).saturating_sub(start.elapsed());
        let late = || io::Error::new(ErrorKind::TimedOut, "The request did not come in time.");
        if left.is_zero() {
            return Err(late());
        }
        // A timeout of zero would be none.
        self.stream.set_read_timeout(Some(patience.min(left).max(Duration::from_millis(1))))?;
        match self.stream.read(buffer) {
            Ok(0) => Err(io::Error::new(ErrorKind::UnexpectedEof, "The client has gone.")),
            Ok(read) => {
                *self.client.heard.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
                Ok(read)
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => Err(late()),
            Err(error) if error.kind() == ErrorKind::Interrupted => self.some(buffer, start),
            Err(error) => Err(error),
        }
    }

    /// Takes room for `bytes` more; false when there is none.
    ///
    /// Each client has room for a plain frame of its own. What a request takes beyond that comes out of a budget of requests
    /// up to `limit`, one for each kind of client, in turn.
    fn hold(&mut self, bytes: usize, limit: usize) -> bool {
        let own = slmpy::plain_limit(&self.shared.panel);
        let beyond = |held: usize| held.saturating_sub(own);
        let more = beyond(self.held + bytes) - beyond(self.held);
        if more > 0 {
            let budget = HELD_REQUESTS * limit.max(slmsuite::request_limit(&self.shared.panel));
            let queue = &self.shared.queues[usize::from(self.client.is_local)];
            if !queue.take(self.client.number, more, budget) {
                return false;
            }
        }
        self.held += bytes;
        let mut request = self.client.request.lock().unwrap_or_else(PoisonError::into_inner);
        let since = request.as_ref().map_or_else(Instant::now, |request| request.since);
        *request = Some(Request { since, beyond: beyond(self.held), waits: false });
        true
    }

    /// Takes room for `bytes` as soon as there is some: who has long held much of a request and sends no more is cut off for
    /// it.
    pub(super) fn wait_for_room(&mut self, bytes: usize, limit: usize) -> Result<(), String> {
        let start = Instant::now();
        while !self.hold(bytes, limit) {
            if start.elapsed() > self.shared.patience {
                self.shared.queues[usize::from(self.client.is_local)].leave(self.client.number);
                return Err(BUSY.to_owned());
            }
            if let Some(request) = &mut *self.client.request.lock().unwrap_or_else(PoisonError::into_inner) {
                request.waits = true;
            }
            self.shared.cut_off_idle(self.client);
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(())
    }

    pub(super) fn release(&mut self) {
        let held = std::mem::take(&mut self.held);
        let beyond = held.saturating_sub(slmpy::plain_limit(&self.shared.panel));
        self.shared.queues[usize::from(self.client.is_local)].give_back(self.client.number, beyond);
        *self.client.request.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

impl Drop for Conversation<'_> {
    fn drop(&mut self) {
        self.release();
    }
}
