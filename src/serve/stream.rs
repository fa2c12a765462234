//! A connection of either kind: over the network, or by a socket in the file system of this machine.

use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
#[cfg(unix)]
use std::os::unix::net::UnixStream;
use std::time::Duration;

/// One end of a connection.
#[derive(Debug)]
pub(super) enum Stream {
    /// Over the network, loopback included.
    Tcp(TcpStream),
    /// On this machine.
    #[cfg(unix)]
    Local(UnixStream),
}

impl Stream {
    /// A second handle on the same connection.
    pub(super) fn try_clone(&self) -> io::Result<Self> {
        match self {
            Self::Tcp(stream) => stream.try_clone().map(Self::Tcp),
            #[cfg(unix)]
            Self::Local(stream) => stream.try_clone().map(Self::Local),
        }
    }

    /// Whose it is: an address, or this machine's.
    pub(super) fn peer(&self) -> String {
        match self {
            Self::Tcp(stream) => stream.peer_addr().map_or_else(|_| "gone".into(), |address| address.to_string()),
            #[cfg(unix)]
            Self::Local(_) => "local".into(),
        }
    }

    /// Ends the connection, whoever is reading from it.
    pub(super) fn shutdown(&self) {
        // One that has ended already needs nothing.
        let _ = match self {
            Self::Tcp(stream) => stream.shutdown(Shutdown::Both),
            #[cfg(unix)]
            Self::Local(stream) => stream.shutdown(Shutdown::Both),
        };
    }

    /// Sends small answers at once, and gives up a client that does not take them within `patience`.
    pub(super) fn prepare(&self, patience: Duration) {
        // Refused, answers come later or wait longer: nothing that a client's own thread could not bear.
        let _ = match self {
            Self::Tcp(stream) => stream.set_nodelay(true).and_then(|()| stream.set_write_timeout(Some(patience))),
            #[cfg(unix)]
            Self::Local(stream) => stream.set_write_timeout(Some(patience)),
        };
    }

    /// Longest wait of a read; none: for ever.
    pub(super) fn set_read_timeout(&self, timeout: Option<Duration>) -> io::Result<()> {
        match self {
            Self::Tcp(stream) => stream.set_read_timeout(timeout),
            #[cfg(unix)]
            Self::Local(stream) => stream.set_read_timeout(timeout),
        }
    }
}

impl Read for Stream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Tcp(stream) => stream.read(buffer),
            #[cfg(unix)]
            Self::Local(stream) => stream.read(buffer),
        }
    }
}

impl Write for Stream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Tcp(stream) => stream.write(bytes),
            #[cfg(unix)]
            Self::Local(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Tcp(stream) => stream.flush(),
            #[cfg(unix)]
            Self::Local(stream) => stream.flush(),
        }
    }
}

/// The address by which this machine reaches a listener on `address`.
pub(super) fn reachable(mut address: SocketAddr) -> SocketAddr {
    if address.ip().is_unspecified() {
        address.set_ip(match address {
            SocketAddr::V4(_) => std::net::Ipv4Addr::LOCALHOST.into(),
            SocketAddr::V6(_) => std::net::Ipv6Addr::LOCALHOST.into(),
        });
    }
    address
}
