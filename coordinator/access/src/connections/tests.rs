//! ConnectionPermits, pace and silence, each at its limit.

use super::*;
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

#[test]
fn one_address_cannot_take_every_place() {
    let permits = ConnectionPermits::new(3, 2);
    let peers: [IpAddr; 2] = ["10.0.0.1".parse().unwrap(), "10.0.0.2".parse().unwrap()];
    let taken = [permits.take(peers[0]), permits.take(peers[0])];
    assert!(taken.iter().all(Option::is_some));
    assert!(permits.take(peers[0]).is_none());
    let third = permits.take(peers[1]);
    assert!(third.is_some() && permits.take(peers[1]).is_none());
    drop(taken);
    assert!(permits.take(peers[1]).is_some());
    drop(third);
    assert!(permits.taken.lock().unwrap().is_empty());
}

#[test]
fn a_process_has_room_for_many() {
    let permits = ConnectionPermits::of_this_process();
    assert!(permits.most_per_peer * 2 <= permits.most && permits.most <= MAX_CONNECTIONS);
    assert!(permits.most_per_peer >= 8);
}

#[test]
fn requests_come_in_bursts_and_then_at_a_pace() {
    let handle = ConnectionHandle::new([127, 0, 0, 1].into(), oneshot::channel().0);
    let burst = REQUEST_BURST.get();
    assert!((0..burst).all(|_| handle.may_ask()));
    // Some time may have passed, and made room for a few.
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
    let begun = Instant::now();
    assert!(connection.read_u8().await.is_err());
    assert!(begun.elapsed() >= IDLE_LIMIT);
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
