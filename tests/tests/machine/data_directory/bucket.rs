//! An object-storage bucket in this process, with the operations that checkpoints need: put, get and remove objects.

use std::{
    collections::BTreeMap,
    io::{BufRead as _, BufReader, Read as _, Write as _},
    net::{TcpListener, TcpStream},
    sync::{Arc, Mutex},
    thread,
};

/// A bucket that listens for as long as the test runs.
pub struct Bucket {
    endpoint: String,
    objects: Arc<Mutex<BTreeMap<String, Vec<u8>>>>,
    puts: Arc<Mutex<u32>>,
}

impl Bucket {
    /// A bucket that accepts all objects if `takes` is true, and refuses all objects otherwise.
    pub fn new(takes: bool) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let bucket = Self {
            endpoint: format!("http://{}", listener.local_addr().unwrap()),
            objects: Arc::default(),
            puts: Arc::default(),
        };
        let (objects, puts) = (bucket.objects.clone(), bucket.puts.clone());
        thread::spawn(move || {
            for stream in listener.incoming() {
                let (objects, puts) = (objects.clone(), puts.clone());
                thread::spawn(move || while answer(stream.as_ref().unwrap(), &objects, &puts, takes) {});
            }
        });
        bucket
    }

    /// The environment variables with which a process finds the bucket.
    pub fn environment(&self) -> [(&str, &str); 5] {
        [
            ("AWS_ENDPOINT", &self.endpoint),
            ("AWS_ALLOW_HTTP", "true"),
            ("AWS_ACCESS_KEY_ID", "somebody"),
            ("AWS_SECRET_ACCESS_KEY", "something"),
            ("AWS_REGION", "us-east-1"),
        ]
    }

    /// Number of objects that were put so far, and number of objects in the bucket now.
    pub fn seen(&self) -> (u32, usize) {
        (*self.puts.lock().unwrap(), self.objects.lock().unwrap().len())
    }
}

/// Answers one request; returns whether another request can follow.
fn answer(
    mut stream: &TcpStream,
    objects: &Mutex<BTreeMap<String, Vec<u8>>>,
    puts: &Mutex<u32>,
    takes: bool,
) -> bool {
    let mut reader = BufReader::new(stream);
    let mut request = String::new();
    if reader.read_line(&mut request).unwrap_or(0) == 0 {
        return false;
    }
    let mut length = 0;
    loop {
        let mut header = String::new();
        reader.read_line(&mut header).unwrap();
        if header.trim().is_empty() {
            break;
        }
        if let Some(value) = header.to_lowercase().strip_prefix("content-length:") {
            length = value.trim().parse().unwrap();
        }
    }
    let mut body = vec![0; length];
    reader.read_exact(&mut body).unwrap();
    let mut words = request.split(' ');
    let (method, path) = (words.next().unwrap(), words.next().unwrap().to_owned());
    let mut objects = objects.lock().unwrap();
    let (status, content) = match method {
        "PUT" if takes => {
            *puts.lock().unwrap() += 1;
            objects.insert(path, body);
            ("200 OK", Vec::new())
        }
        "PUT" => (
            "403 Forbidden",
            b"<Error><Code>AccessDenied</Code></Error>".to_vec(),
        ),
        "GET" => match objects.get(&path) {
            Some(object) => ("200 OK", object.clone()),
            None => ("404 Not Found", Vec::new()),
        },
        // One request can remove several objects; its body has the keys of the objects.
        "POST" => {
            let (bucket, _) = path.split_once('?').unwrap();
            let wanted = String::from_utf8(body).unwrap();
            let keys = wanted
                .split("<Key>")
                .skip(1)
                .map(|rest| rest.split_once('<').unwrap().0);
            for key in keys {
                objects.remove(&format!("{}/{key}", bucket.trim_end_matches('/')));
            }
            let done = "<DeleteResult xmlns=\"http://s3.amazonaws.com/doc/2006-03-01/\"></DeleteResult>";
            ("200 OK", done.into())
        }
        _ => ("501 Not Implemented", Vec::new()),
    };
    let head = format!(
        "HTTP/1.1 {status}\r\netag: \"1\"\r\nlast-modified: Sun, 22 Nov 2026 10:00:00 GMT\r\ncontent-length: {}\r\n\r\n",
        content.len()
    );
    stream.write_all(&[head.into_bytes(), content].concat()).is_ok()
}
