//! Permits, pace and silence of connections, each at its limit.

use super::*;
use std::net::SocketAddr;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio_stream::StreamExt as _;

async fn listen(permits: ConnectionPermits) -> (SocketAddr, ReceiverStream<io::Result<Connection>>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    (address, connections(listener, permits))
}

#[tokio::test]
async fn one_too_many_is_closed_and_room_is_made_again() {
    let (address, mut taken) = listen(ConnectionPermits::new(4, 2)).await;
    let mut clients = Vec::new();
    let mut served = Vec::new();
    for _ in 0..2 {
        clients.push(TcpStream::connect(address).await.unwrap());
        served.push(taken.next().await.unwrap().unwrap());
    }
    let mut refused = TcpStream::connect(address).await.unwrap();
    assert_eq!(refused.read(&mut [0]).await.unwrap_or(0), 0);
    served.pop();
    let mut client = TcpStream::connect(address).await.unwrap();
    client.write_all(b"a").await.unwrap();
    let mut connection = taken.next().await.unwrap().unwrap();
    assert_eq!(connection.read_u8().await.unwrap(), b'a');
}

/// A handle of a connection from `address`, and the receiver of the order to close it.
fn handle(address: &str) -> (ConnectionHandle, oneshot::Receiver<()>) {
    let (close, told) = oneshot::channel();
    (ConnectionHandle::new(address.parse().unwrap(), close), told)
}

fn take(permits: &ConnectionPermits, handle: &ConnectionHandle) -> Option<ConnectionPermit> {
    permits.take(handle.peer(), handle)
}

#[test]
fn one_address_cannot_take_every_place() {
    let permits = ConnectionPermits::new(3, 2);
    let (first, second) = (handle("10.0.0.1").0, handle("10.0.0.2").0);
    let taken = [take(&permits, &first), take(&permits, &first)];
    assert!(taken.iter().all(Option::is_some));
    assert!(take(&permits, &first).is_none());
    let third = take(&permits, &second);
    assert!(third.is_some());
    drop(taken);
    assert!(take(&permits, &second).is_some());
    drop(third);
    assert!(permits.taken.lock().unwrap().by_peer.is_empty());
}

#[test]
fn addresses_of_one_network_are_one_peer() {
    let permits = ConnectionPermits::new(9, 2);
    let taken = ["fd77::1", "fd77::2"].map(|address| take(&permits, &handle(address).0));
    assert!(taken.iter().all(Option::is_some));
    assert!(take(&permits, &handle("fd77::3").0).is_none());
    assert!(take(&permits, &handle("fd77:0:0:1::3").0).is_some());
}

#[test]
fn a_newcomer_takes_the_place_of_a_stranger_with_many_connections() {
    let permits = ConnectionPermits::new(5, 3);
    let of_first = [(); 3].map(|()| handle("10.0.0.1"));
    let of_second = [(); 2].map(|()| handle("10.0.0.2"));
    // The oldest connection is authenticated.
    of_first[0].0.authenticated();
    let held = of_first.iter().chain(&of_second);
    let mut held: Vec<_> = held.map(|(handle, _)| take(&permits, handle).unwrap()).collect();
    let newcomer = take(&permits, &handle("10.0.0.3").0);
    assert!(newcomer.is_some());
    let [(_, mut known), (_, mut oldest), (_, mut newest)] = of_first;
    assert!(known.try_recv().is_err() && oldest.try_recv().is_ok() && newest.try_recv().is_err());
    // Returning the permit of the closed connection frees no second place.
    drop(held.remove(1));
    assert_eq!(
        permits
            .taken
            .lock()
            .unwrap()
            .by_peer
            .values()
            .map(BTreeMap::len)
            .sum::<usize>(),
        5
    );
    // The newcomer's next connection takes the place of the oldest unauthenticated connection of an address with more
    // connections.
    let [(_, mut first_of_second), (_, mut second_of_second)] = of_second;
    let further = take(&permits, &handle("10.0.0.3").0);
    assert!(further.is_some());
    assert!(newest.try_recv().is_ok() && known.try_recv().is_err());
    assert!(first_of_second.try_recv().is_err() && second_of_second.try_recv().is_err());
    // A newcomer with as many connections as each other address gets no further connection.
    assert!(take(&permits, &handle("10.0.0.3").0).is_none());
}

#[test]
fn places_that_many_addresses_hold_go_to_newcomers_too() {
    let permits = ConnectionPermits::new(3, 2);
    let strangers = ["10.0.0.1", "10.0.0.2", "10.0.0.3"].map(handle);
    let held = strangers
        .each_ref()
        .map(|(handle, _)| take(&permits, handle).unwrap());
    let [(known, mut of_known), (_, mut oldest), (_, mut newest)] = strangers;
    known.authenticated();
    assert!(take(&permits, &handle("10.0.0.4").0).is_some());
    assert!(of_known.try_recv().is_err() && oldest.try_recv().is_ok() && newest.try_recv().is_err());
    drop(held);
}

#[tokio::test]
async fn a_connection_that_only_writes_is_closed() {
    let (address, mut taken) = listen(ConnectionPermits::new(4, 4)).await;
    let _client = TcpStream::connect(address).await.unwrap();
    let mut connection = taken.next().await.unwrap().unwrap();
    let handle = connection.connect_info();
    let closing = async {
        tokio::time::sleep(Duration::from_millis(50)).await;
        handle.close();
    };
    // The bytes exceed the buffers of both ends, and nobody reads the bytes.
    let bytes = vec![0; 64 << 20];
    let (written, ()) = tokio::join!(connection.write_all(&bytes), closing);
    assert_eq!(written.unwrap_err().kind(), io::ErrorKind::TimedOut);
}

#[test]
fn a_process_has_room_for_many() {
    let permits = ConnectionPermits::of_this_process();
    assert!(permits.most_per_peer * 2 <= permits.most && permits.most <= MAX_CONNECTIONS);
    assert!(permits.most_per_peer >= 8);
}

#[test]
fn requests_come_in_bursts_and_then_at_a_pace() {
    let (handle, _) = handle("127.0.0.1");
    let burst = REQUEST_BURST.get();
    assert!((0..burst).all(|_| handle.may_ask()));
    // Some time may have passed, so that a few more requests are allowed.
    let further = (0..2 * burst).filter(|_| handle.may_ask()).count();
    assert!(further < 2 * burst as usize, "{further}");
}

#[tokio::test(start_paused = true)]
async fn who_says_nothing_is_let_go() {
    let (address, mut taken) = listen(ConnectionPermits::new(4, 4)).await;
    let _client = TcpStream::connect(address).await.unwrap();
    let mut connection = taken.next().await.unwrap().unwrap();
    let begun = Instant::now();
    let silent = connection.read_u8().await.unwrap_err();
    assert_eq!(silent.kind(), io::ErrorKind::TimedOut);
    assert!(begun.elapsed() >= HANDSHAKE_LIMIT);

    let mut client = TcpStream::connect(address).await.unwrap();
    let mut connection = taken.next().await.unwrap().unwrap();
    client.write_all(b"a").await.unwrap();
    assert_eq!(connection.read_u8().await.unwrap(), b'a');
    connection.handle.authenticated();
    let begun = Instant::now();
    assert!(connection.read_u8().await.is_err());
    assert!(begun.elapsed() >= IDLE_LIMIT);
}

#[tokio::test(start_paused = true)]
async fn bytes_that_are_no_request_do_not_keep_a_connection() {
    let (address, mut taken) = listen(ConnectionPermits::new(4, 4)).await;
    let mut client = TcpStream::connect(address).await.unwrap();
    let mut connection = taken.next().await.unwrap().unwrap();
    let begun = Instant::now();
    while begun.elapsed() < FIRST_REQUEST_LIMIT {
        if client.write_all(b"a").await.is_err() || connection.read_u8().await.is_err() {
            break;
        }
        tokio::time::sleep(HANDSHAKE_LIMIT / 2).await;
    }
    assert!(connection.read_u8().await.is_err());
    assert!(begun.elapsed() < FIRST_REQUEST_LIMIT + HANDSHAKE_LIMIT);
}

#[tokio::test]
async fn a_visit_closes_its_connection_while_it_waits_and_later() {
    let (address, mut taken) = listen(ConnectionPermits::new(4, 4)).await;
    let mut client = TcpStream::connect(address).await.unwrap();
    let mut connection = taken.next().await.unwrap().unwrap();
    let handle = connection.connect_info();
    let closing = async {
        tokio::task::yield_now().await;
        handle.close();
        handle.close();
    };
    let (read, ()) = tokio::join!(connection.read_u8(), closing);
    assert_eq!(read.unwrap_err().kind(), io::ErrorKind::TimedOut);
    client.write_all(b"a").await.unwrap();
    assert!(connection.read_u8().await.is_err());
}

#[tokio::test]
async fn a_machine_that_connects_by_its_own_address_is_this_machine() {
    let listener = TcpListener::bind("127.0.0.5:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let peer = async |from: &str| {
        let socket = tokio::net::TcpSocket::new_v4().unwrap();
        socket.bind(from.parse().unwrap()).unwrap();
        let (connected, accepted) = tokio::join!(socket.connect(address), listener.accept());
        connected.unwrap();
        let (stream, peer) = accepted.unwrap();
        machine_at(&stream, peer.ip())
    };
    assert_eq!(peer("127.0.0.5:0").await, Ipv4Addr::LOCALHOST);
    assert_eq!(peer("127.0.0.6:0").await, Ipv4Addr::new(127, 0, 0, 6));
}
