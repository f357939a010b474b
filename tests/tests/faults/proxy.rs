//! A proxy between workers and coordinator that delays or drops bytes.

use std::{
    io::{Read as _, Write as _},
    net::{Shutdown, TcpListener, TcpStream},
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc,
    },
    thread,
    time::{Duration, Instant},
};

/// Forwards connections to an address until the process ends.
pub struct Proxy {
    address: String,
    state: Arc<State>,
}

struct State {
    /// Whether bytes are dropped, without a sign to either end.
    cut: AtomicBool,
    /// Delay in each direction, milliseconds.
    delay_ms: u64,
    /// Number of forwarded bytes.
    passed: AtomicU64,
}

impl Proxy {
    pub fn before(address: &str, delay_ms: u64) -> Self {
        Self::listening("127.0.0.1:0", address, delay_ms)
    }

    pub fn listening(listen: &str, address: &str, delay_ms: u64) -> Self {
        let listener = TcpListener::bind(listen).unwrap();
        let own = listener.local_addr().unwrap().to_string();
        let state = Arc::new(State {
            cut: AtomicBool::new(false),
            delay_ms,
            passed: AtomicU64::new(0),
        });
        let (to, shared) = (address.to_owned(), state.clone());
        thread::spawn(move || {
            for client in listener.incoming().map_while(Result::ok) {
                let Ok(server) = TcpStream::connect(&to) else {
                    continue;
                };
                for (from, to) in [(&client, &server), (&server, &client)] {
                    let (from, to) = (from.try_clone().unwrap(), to.try_clone().unwrap());
                    // With a delay by TCP, small messages would wait for one another, unlike on a real network.
                    to.set_nodelay(true).unwrap();
                    forward(from, to, shared.clone());
                }
            }
        });
        Self { address: own, state }
    }

    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Starts or stops dropping bytes.
    pub fn cut(&self, cut: bool) {
        self.state.cut.store(cut, Ordering::SeqCst);
    }

    pub fn passed(&self) -> u64 {
        self.state.passed.load(Ordering::SeqCst)
    }
}

/// Forwards one direction of a connection: one thread reads, another thread writes after the delay.
fn forward(mut from: TcpStream, mut to: TcpStream, state: Arc<State>) {
    let (sender, parcels) = mpsc::sync_channel::<(Instant, Vec<u8>)>(1024);
    let delay = Duration::from_millis(state.delay_ms);
    thread::spawn(move || {
        let mut buffer = [0; 16 << 10];
        while let Ok(read @ 1..) = from.read(&mut buffer) {
            if sender
                .send((Instant::now() + delay, buffer[..read].to_vec()))
                .is_err()
            {
                break;
            }
        }
    });
    thread::spawn(move || {
        for (due, bytes) in parcels {
            thread::sleep(due.saturating_duration_since(Instant::now()));
            while state.cut.load(Ordering::SeqCst) {
                thread::sleep(Duration::from_millis(10));
            }
            if to.write_all(&bytes).is_err() {
                break;
            }
            state.passed.fetch_add(bytes.len() as u64, Ordering::SeqCst);
        }
        // The connection may be closed already.
        let _ = to.shutdown(Shutdown::Both);
    });
}
