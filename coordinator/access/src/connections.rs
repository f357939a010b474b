//! The connections of a listener: limits on their number, on their silence, and on the rate of their requests.
//!
//! A connection over a limit is closed at once, so that no client waits for a response. This module does not read the bytes of a
//! connection.

use crate::limits::{
    FIRST_REQUEST_LIMIT, HANDSHAKE_LIMIT, IDLE_LIMIT, MAX_CONNECTIONS, MAX_CONNECTIONS_PER_PEER,
    MAX_LOCAL_CONNECTIONS, REQUEST_BURST, REQUESTS_PER_SECOND, RESERVED_FILES, STRANGER_IDLE_LIMIT,
};
use governor::{DefaultDirectRateLimiter, Quota, RateLimiter};
use std::{
    cmp::Reverse,
    collections::{BTreeMap, HashMap},
    io,
    net::{IpAddr, Ipv4Addr, Ipv6Addr},
    pin::Pin,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU8, Ordering},
    },
    task::{Context, Poll, ready},
    time::Duration,
};
use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    net::{TcpListener, TcpStream},
    sync::{mpsc, oneshot},
    time::{Instant, Sleep},
};
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::server::Connected;

/// Number of connections that may wait to be served.
const WAITING: usize = 64;
/// Pause after the system could not accept a connection, for example because no file descriptor is left.
const PAUSE: Duration = Duration::from_millis(100);

/// The permits for the connections of a listener; cheap to clone.
#[derive(Debug, Clone)]
pub struct ConnectionPermits {
    most: usize,
    most_per_peer: usize,
    taken: Arc<Mutex<TakenPermits>>,
}

/// The open connections of each address; for IPv6, of each /64 network.
#[derive(Debug, Default)]
struct TakenPermits {
    /// The connections of each address by number, so that the oldest connection comes first.
    by_peer: HashMap<IpAddr, BTreeMap<u64, ConnectionHandle>>,
    next: u64,
}

/// The permit of one connection. Dropping the permit returns it.
#[derive(Debug)]
struct ConnectionPermit {
    permits: ConnectionPermits,
    network: IpAddr,
    number: u64,
}

impl ConnectionPermits {
    /// As many permits as the system allows this process to have connections, at most [`MAX_CONNECTIONS`].
    pub fn of_this_process() -> Self {
        let reserved = RESERVED_FILES + MAX_LOCAL_CONNECTIONS as u64;
        let wanted = MAX_CONNECTIONS as u64 + reserved;
        // A system that reports no limit on open files has no limit.
        let files = rlimit::increase_nofile_limit(wanted).unwrap_or(wanted);
        let most = files.saturating_sub(reserved).clamp(16, MAX_CONNECTIONS as u64) as usize;
        Self::new(most, MAX_CONNECTIONS_PER_PEER.min(most / 2))
    }

    /// Permits for the endpoint that only this machine reaches, in addition to the permits of other endpoints.
    pub fn of_this_machine() -> Self {
        Self::new(MAX_LOCAL_CONNECTIONS, MAX_LOCAL_CONNECTIONS)
    }

    fn new(most: usize, most_per_peer: usize) -> Self {
        Self {
            most,
            most_per_peer,
            taken: Arc::default(),
        }
    }

    /// Takes a permit for a connection of `peer`. If all permits are taken, this closes the oldest unauthenticated connection of
    /// the address with the most connections, provided that this address has more connections than `peer`.
    fn take(&self, peer: IpAddr, handle: &ConnectionHandle) -> Option<ConnectionPermit> {
        let network = network_of(peer);
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        let of_peer = taken.by_peer.get(&network).map_or(0, BTreeMap::len);
        let total: usize = taken.by_peer.values().map(BTreeMap::len).sum();
        if of_peer >= self.most_per_peer || (total >= self.most && !taken.make_room(of_peer)) {
            return None;
        }
        let number = taken.next;
        taken.next += 1;
        let of_peer = taken.by_peer.entry(network).or_default();
        of_peer.insert(number, handle.clone());
        Some(ConnectionPermit {
            permits: self.clone(),
            network,
            number,
        })
    }
}

impl TakenPermits {
    /// Chooses the address with the most connections among addresses that have an unauthenticated connection, and more than
    /// `fewer` connections in all. Closes the oldest unauthenticated connection of this address.
    fn make_room(&mut self, fewer: usize) -> bool {
        let oldest_stranger = |of_peer: &BTreeMap<u64, ConnectionHandle>| {
            let stranger = of_peer.iter().find(|(_, handle)| !handle.is_authenticated());
            stranger.map(|(number, _)| *number)
        };
        let with_strangers = self.by_peer.values_mut().filter_map(|of_peer| {
            let number = oldest_stranger(of_peer).filter(|_| of_peer.len() > fewer)?;
            Some((of_peer, number))
        });
        let most = with_strangers.max_by_key(|(of_peer, number)| (of_peer.len(), Reverse(*number)));
        let closed = most.and_then(|(of_peer, number)| of_peer.remove(&number));
        closed.map(|handle| handle.close()).is_some()
    }
}

impl Drop for ConnectionPermit {
    fn drop(&mut self) {
        let mut taken = self.permits.taken.lock().unwrap_or_else(PoisonError::into_inner);
        let of_peer = taken.by_peer.get_mut(&self.network);
        let is_last = of_peer.is_some_and(|of_peer| {
            of_peer.remove(&self.number);
            of_peer.is_empty()
        });
        if is_last {
            taken.by_peer.remove(&self.network);
        }
    }
}

/// The address; for IPv6, its /64 network, because one machine may own a whole /64 network.
pub(crate) fn network_of(address: IpAddr) -> IpAddr {
    match address {
        IpAddr::V6(address) => Ipv6Addr::from_bits(address.to_bits() >> 64 << 64).into(),
        IpAddr::V4(_) => address,
    }
}

/// The connections of `listener`; dropping the stream closes the listener.
pub fn connections(
    listener: TcpListener,
    permits: ConnectionPermits,
) -> ReceiverStream<io::Result<Connection>> {
    let (waiting, stream) = mpsc::channel(WAITING);
    tokio::spawn(async move {
        loop {
            let accepted = tokio::select! {
                accepted = listener.accept() => accepted,
                () = waiting.closed() => return,
            };
            let (stream, peer) = match accepted {
                Ok(accepted) => accepted,
                Err(error) => {
                    tracing::warn!(%error, "cannot accept a connection");
                    tokio::time::sleep(PAUSE).await;
                    continue;
                }
            };
            let (close, told) = oneshot::channel();
            let handle = ConnectionHandle::new(machine_at(&stream, peer.ip()), close);
            let Some(permit) = permits.take(handle.peer(), &handle) else {
                tracing::debug!(%peer, "too many connections");
                continue;
            };
            let connection = Connection::new(stream, handle, told, permit);
            if waiting.send(Ok(connection)).await.is_err() {
                return;
            }
        }
    });
    ReceiverStream::new(stream)
}

/// The address that stands for the machine at the other end. A process of this machine that connects by the machine's own address
/// counts as one that connects on loopback: one machine has one vote.
fn machine_at(stream: &TcpStream, peer: IpAddr) -> IpAddr {
    let peer = peer.to_canonical();
    match stream.local_addr() {
        Ok(own) if own.ip().to_canonical() == peer => Ipv4Addr::LOCALHOST.into(),
        _ => peer,
    }
}

/// A connection that fails once no byte has passed on it for too long.
#[derive(Debug)]
pub struct Connection {
    stream: TcpStream,
    handle: ConnectionHandle,
    begun: Instant,
    /// Time at which the last byte passed.
    active: Instant,
    alarm: Pin<Box<Sleep>>,
    /// Receives the order to close the connection; `None` once the order has arrived.
    close: Option<oneshot::Receiver<()>>,
    _permit: ConnectionPermit,
}

/// The connection of a request, as an extension of the request.
#[derive(Debug, Clone)]
pub struct ConnectionHandle {
    peer: IpAddr,
    pace: Arc<DefaultDirectRateLimiter>,
    progress: Arc<AtomicU8>,
    close: Arc<Mutex<Option<oneshot::Sender<()>>>>,
}

/// Progress of a connection, in increasing values.
const NO_REQUEST: u8 = 0;
const REQUESTS: u8 = 1;
const AUTHENTICATED: u8 = 2;

impl ConnectionHandle {
    fn new(peer: IpAddr, close: oneshot::Sender<()>) -> Self {
        let quota = Quota::per_second(REQUESTS_PER_SECOND).allow_burst(REQUEST_BURST);
        Self {
            peer,
            pace: Arc::new(RateLimiter::direct(quota)),
            progress: Arc::new(AtomicU8::new(NO_REQUEST)),
            close: Arc::new(Mutex::new(Some(close))),
        }
    }

    /// Closes the connection.
    pub(crate) fn close(&self) {
        let close = self.close.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(close) = close {
            // The connection may be closed already.
            let _ = close.send(());
        }
    }

    /// Address of the other end; an IPv4 address in IPv6 form is converted to IPv4.
    pub(crate) const fn peer(&self) -> IpAddr {
        self.peer
    }

    /// Whether a further request is allowed now; an allowed request is counted.
    pub(crate) fn may_ask(&self) -> bool {
        self.progress.fetch_max(REQUESTS, Ordering::Relaxed);
        self.pace.check().is_ok()
    }

    /// Records that a request on this connection was authenticated, or was admitted because the route admits everybody.
    pub(crate) fn authenticated(&self) {
        self.progress.fetch_max(AUTHENTICATED, Ordering::Relaxed);
    }

    fn is_authenticated(&self) -> bool {
        self.progress.load(Ordering::Relaxed) == AUTHENTICATED
    }
}

impl Connection {
    fn new(
        stream: TcpStream,
        handle: ConnectionHandle,
        close: oneshot::Receiver<()>,
        permit: ConnectionPermit,
    ) -> Self {
        if let Err(error) = stream.set_nodelay(true) {
            tracing::debug!(peer = %handle.peer(), %error, "answers may be delayed");
        }
        let now = Instant::now();
        Self {
            stream,
            handle,
            begun: now,
            active: now,
            alarm: Box::pin(tokio::time::sleep(HANDSHAKE_LIMIT)),
            close: Some(close),
            _permit: permit,
        }
    }

    fn passed(&mut self) {
        self.active = Instant::now();
    }

    /// Time at which the connection is closed if no further byte passes.
    fn end(&self) -> Instant {
        match self.handle.progress.load(Ordering::Relaxed) {
            NO_REQUEST => (self.active + HANDSHAKE_LIMIT).min(self.begun + FIRST_REQUEST_LIMIT),
            REQUESTS => self.active + STRANGER_IDLE_LIMIT,
            _ => self.active + IDLE_LIMIT,
        }
    }

    /// Whether the connection has received the order to close.
    fn is_closed(&mut self, context: &mut Context<'_>) -> bool {
        if let Some(close) = &mut self.close
            && Pin::new(close).poll(context).is_ready()
        {
            self.close = None;
        }
        self.close.is_none()
    }

    /// Ready once the connection has been silent for too long. The alarm is set again only when it goes off, not for every byte.
    fn is_silent(&mut self, context: &mut Context<'_>) -> Poll<()> {
        loop {
            ready!(self.alarm.as_mut().poll(context));
            let end = self.end();
            if end <= Instant::now() {
                return Poll::Ready(());
            }
            self.alarm.as_mut().reset(end);
        }
    }
}

impl Connected for Connection {
    type ConnectInfo = ConnectionHandle;

    fn connect_info(&self) -> ConnectionHandle {
        self.handle.clone()
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if self.is_closed(context) {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        match Pin::new(&mut self.stream).poll_read(context, buffer) {
            Poll::Ready(read) => {
                self.passed();
                Poll::Ready(read)
            }
            Poll::Pending => {
                ready!(self.is_silent(context));
                Poll::Ready(Err(io::ErrorKind::TimedOut.into()))
            }
        }
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        if self.is_closed(context) {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        let written = ready!(Pin::new(&mut self.stream).poll_write(context, bytes));
        self.passed();
        Poll::Ready(written)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        if self.is_closed(context) {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        if self.is_closed(context) {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        let written = ready!(Pin::new(&mut self.stream).poll_write_vectored(context, slices));
        self.passed();
        Poll::Ready(written)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}

#[cfg(test)]
mod tests;
