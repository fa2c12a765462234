//! A server on this machine, and clients that say anything to it.

use crate::seeds::{Fault, panel};
use holodrive::serve::{Announcement, Driver, Flip, ServeSettings, Server};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long a client waits for an answer. The server's patience is longer: a lawful pause is no fault.
const PATIENCE: Duration = Duration::from_millis(500);

/// A server whose frames are taken and answered at once.
pub struct Served {
    spoken: Announcement,
    over: Arc<AtomicBool>,
    keeper: Option<JoinHandle<()>>,
    _folder: tempfile::TempDir,
}

impl Served {
    /// Starts one that speaks all protocols.
    pub fn start() -> Result<Self, Fault> {
        let folder = tempfile::tempdir()?;
        let driver = Driver::new(&panel()?, 532e-9, None)?;
        let free = Some(SocketAddr::from(([127, 0, 0, 1], 0)));
        let local = Some(folder.path().join("panel.sock"));
        let settings = ServeSettings { slmsuite: free, slmpy: free, local, ..ServeSettings::default() };
        let server = Server::start(driver.served("panel")?, &settings)?;
        let spoken = server.announcement();
        let over = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&over);
        let keeper = std::thread::spawn(move || {
            let mut number = 0;
            while !ended.load(Ordering::Relaxed) {
                if let Some(mut request) = server.next(Duration::from_millis(50)) {
                    match driver.frame(request.take_frame()) {
                        Ok(_) => {
                            number += 1;
                            request.shown(Flip { at: Instant::now(), number, missed: 0 });
                        }
                        Err(why) => request.refused(&why.to_string()),
                    }
                }
            }
        });
        Ok(Self { spoken, over, keeper: Some(keeper), _folder: folder })
    }

    /// Says it all, ends, and reads what is answered; the error is the answer that is no line of text.
    pub fn hear(&self, protocol: &str, said: &[u8]) -> Result<(), String> {
        let mut answer = Vec::new();
        let outcome = match protocol {
            "slmsuite" => self.spoken.slmsuite.map(|address| over_tcp(address, said, &mut answer)),
            "slmpy" => self.spoken.slmpy.map(|address| over_tcp(address, said, &mut answer)),
            _ => self.local(said, &mut answer),
        };
        // A server that refuses may end the connection before all is said.
        drop(outcome);
        let printable = |b: &u8| *b >= b' ' || *b == b'\n';
        if answer.iter().all(printable) && answer.len() < 1 << 16 {
            Ok(())
        } else {
            Err(String::from_utf8_lossy(&answer).into_owned())
        }
    }

    #[cfg(unix)]
    fn local(&self, said: &[u8], answer: &mut Vec<u8>) -> Option<std::io::Result<()>> {
        use std::os::unix::net::UnixStream;
        let path = self.spoken.local.as_ref()?;
        Some(UnixStream::connect(path).and_then(|mut stream| {
            stream.set_read_timeout(Some(PATIENCE))?;
            stream.write_all(said)?;
            stream.shutdown(std::net::Shutdown::Write)?;
            stream.read_to_end(answer).map(drop)
        }))
    }

    #[cfg(not(unix))]
    fn local(&self, _: &[u8], _: &mut Vec<u8>) -> Option<std::io::Result<()>> {
        None
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        // A keeper that broke has said so.
        let _ = self.keeper.take().map(JoinHandle::join);
    }
}

fn over_tcp(address: SocketAddr, said: &[u8], answer: &mut Vec<u8>) -> std::io::Result<()> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.write_all(said)?;
    stream.shutdown(std::net::Shutdown::Write)?;
    stream.read_to_end(answer).map(drop)
}
