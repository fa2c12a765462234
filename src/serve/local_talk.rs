//! The local protocol's conversation: a line for each frame, whose array stands in a file that both have, or is sent.

use super::SentFrame;
use super::clients::REFUSED;
use super::conversation::Conversation;
use super::local::{self, Source, WIDEST};
use super::local_port::KEY_LINE;
use super::local_request::{self, ArrayType, Command};
#[cfg(unix)]
use super::local_socket::Buffer;
use std::io::{self, ErrorKind};
use std::time::Instant;

/// How arrays come.
enum Arrays {
    /// In memory that the client shares.
    #[cfg(unix)]
    Shared(Buffer),
    /// After the answer that asks for them.
    Sent,
}

impl Conversation<'_> {
    /// By the socket.
    #[cfg(unix)]
    pub(super) fn local(&mut self) -> io::Result<()> {
        match Buffer::new(self.shared.local_folder(), &self.shared.panel) {
            Ok(buffer) => self.talk(&Arrays::Shared(buffer)),
            Err(error) => self.reply(local::refusal(&error.to_string()).as_bytes()),
        }
    }

    /// By the port: whoever does not know its key is told nothing.
    pub(super) fn local_port(&mut self) -> io::Result<()> {
        let line = self.line(KEY_LINE, None)?;
        self.release();
        if self.shared.port.as_ref().is_some_and(|port| port.opens(&line)) {
            return self.talk(&Arrays::Sent);
        }
        let why = "The key is not that of this server's file.";
        self.refuse("local", why);
        self.reply(local::refusal(why).as_bytes())
    }

    fn talk(&mut self, arrays: &Arrays) -> io::Result<()> {
        let shared = self.shared;
        let place = match arrays {
            #[cfg(unix)]
            Arrays::Shared(buffer) => Some(buffer.place()),
            Arrays::Sent => None,
        };
        self.reply(local::greeting(&shared.panel, place).as_bytes())?;
        loop {
            let mut first = [0];
            self.wait_for_first(&mut first)?;
            let arrived = Instant::now();
            let line = match self.line(local_request::LINE_LIMIT, Some(first[0])) {
                Ok(line) => line,
                Err(error) => {
                    self.refuse("local", &error.to_string());
                    let _ = self.reply(local::refusal(&error.to_string()).as_bytes());
                    return Err(error);
                }
            };
            self.release();
            let asked = match local_request::read(&line) {
                Ok(Command::Mapped) => {
                    match arrays {
                        #[cfg(unix)]
                        Arrays::Shared(buffer) => buffer.unlink(),
                        Arrays::Sent => {}
                    }
                    Ok(None)
                }
                Ok(Command::Array(task, array)) => {
                    let frame = self.array(array, arrays)?;
                    self.release();
                    frame.map(|frame| Some((task, frame)))
                }
                Ok(Command::Other(task)) => Ok(Some((task, SentFrame::default()))),
                Err(why) => Err(why),
            };
            let outcome = asked.inspect_err(|_| _ = shared.count(REFUSED)).and_then(|asked| match asked {
                None => Ok(None),
                Some((task, frame)) => self.ask(task, frame).map(Some),
            });
            self.told_outcome("local", &outcome);
            let answer = match outcome {
                Ok(None) => local::done(),
                Ok(Some(done)) => local::answer(&done, arrived),
                Err(why) => local::refusal(&why),
            };
            self.reply(answer.as_bytes())?;
        }
    }

    /// An array of a request. The outer error ends the connection: where the next request begins is not known then.
    fn array(&mut self, array: ArrayType, arrays: &Arrays) -> io::Result<Result<SentFrame, String>> {
        let shared = self.shared;
        let room = local::check(array, &shared.panel).and_then(|()| {
            let bytes = WIDEST * shared.panel.pixels();
            self.wait_for_room(bytes, bytes)
        });
        if let Err(why) = room {
            return Ok(Err(why));
        }
        match arrays {
            #[cfg(unix)]
            Arrays::Shared(buffer) => Ok(local::take(array, &shared.panel, &mut &*buffer)),
            Arrays::Sent => {
                self.reply(local::send(array.dtype.bytes() * shared.panel.pixels()).as_bytes())?;
                let mut sent = Sent { conversation: self, start: Instant::now(), failed: None };
                let frame = local::take(array, &shared.panel, &mut sent);
                match sent.failed {
                    Some(error) => Err(error),
                    None => Ok(frame),
                }
            }
        }
    }
}

/// An array that is coming in.
struct Sent<'a, 'b> {
    conversation: &'a mut Conversation<'b>,
    start: Instant,
    failed: Option<io::Error>,
}

impl Source for Sent<'_, '_> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<(), String> {
        self.conversation.whole(bytes, self.start).map_err(|error| {
            let what = error.to_string();
            if error.kind() == ErrorKind::TimedOut {
                self.conversation.refuse("local", &what);
            }
            self.failed = Some(error);
            what
        })
    }
}
