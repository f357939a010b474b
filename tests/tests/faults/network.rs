//! Networks that are slow, cut, or lose packets.

use super::{
    Scale,
    campaign::{Undisturbed, campaign},
    proxy::Proxy,
    table::Row,
};
use murmuration_tests::ProcessCluster;
use std::{
    process::Command,
    thread,
    time::{Duration, Instant},
};

pub fn partitions(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let count = scale.partitions;
    let spec = campaign(scale, 40 * count + 20, 1000);
    let mut cluster = ProcessCluster::start(0);
    let proxies = [(); 2].map(|()| Proxy::before(cluster.address(), 0));
    let urls = proxies.each_ref().map(Proxy::url);
    let _workers = urls.map(|url| cluster.worker(&url, "murmuration-worker"));
    let id = cluster.submit(&spec);
    let mut noticed = Vec::new();
    for cut in 0..count {
        cluster.wait_to_strike(&id, |status| {
            status.generations_done > 40 * cut && status.workers == 2
        });
        proxies.iter().for_each(|proxy| proxy.cut(true));
        let begun = Instant::now();
        cluster.wait_to_strike(&id, |status| status.workers == 0);
        noticed.push(begun.elapsed());
        // After this pause, the workers have noticed the cut too, and keep trying to reconnect.
        thread::sleep(Duration::from_secs(2));
        proxies.iter().for_each(|proxy| proxy.cut(false));
    }
    let digest = cluster.finish(&id);
    let longest = noticed.iter().max().unwrap();
    assert!(
        *longest < Duration::from_secs(6),
        "noticed after {longest:?} only"
    );
    Row {
        done: format!(
            "{count} times all workers cut off without a word until they were missed, and 2 s more"
        ),
        found: format!(
            "missed after {:.1} s at most; {}",
            longest.as_secs_f64(),
            undisturbed.check(&spec, &digest)
        ),
    }
}

pub fn latency(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = campaign(scale, 20, 1000);
    let mut cluster = ProcessCluster::start(0);
    let proxy = Proxy::before(cluster.address(), 100);
    let url = proxy.url();
    let _workers = [(); 2].map(|()| cluster.worker(&url, "murmuration-worker"));
    let id = cluster.submit(&spec);
    let digest = cluster.finish(&id);
    assert!(proxy.passed() > 100_000, "the work went another way");
    Row {
        done: "200 ms there and back between coordinator and workers".to_owned(),
        found: undisturbed.check(&spec, &digest),
    }
}

/// A separate network namespace, connected to the test's own namespace by a pair of devices. Dropping a `Namespace` removes it.
struct Namespace {
    name: String,
    subnet: String,
}

impl Namespace {
    /// Makes a namespace. Panics if this process is not allowed to make one.
    fn new() -> Self {
        let number = std::process::id() % 200 + 20;
        let namespace = Self {
            name: format!("murmuration-{number}"),
            subnet: format!("10.{number}.77"),
        };
        let Self { name, subnet } = &namespace;
        let (outside, inside) = (format!("mo{number}"), format!("mi{number}"));
        for command in [
            format!("ip netns add {name}"),
            format!("ip link add {outside} type veth peer name {inside}"),
            format!("ip link set {inside} netns {name}"),
            format!("ip addr add {subnet}.1/24 dev {outside}"),
            format!("ip link set {outside} up"),
            format!("ip netns exec {name} ip addr add {subnet}.2/24 dev {inside}"),
            format!("ip netns exec {name} ip link set {inside} up"),
        ] {
            assert!(run(&command), "{command}");
        }
        namespace
    }
}

impl Drop for Namespace {
    fn drop(&mut self) {
        run(&format!("ip netns del {}", self.name));
    }
}

fn run(command: &str) -> bool {
    let mut words = command.split_whitespace();
    let mut process = Command::new(words.next().unwrap());
    process
        .args(words)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null());
    process.status().is_ok_and(|status| status.success())
}

pub fn loss(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let namespace = Namespace::new();
    let drops = format!(
        "ip netns exec {} iptables -A INPUT -m statistic --mode random --probability 0.05 -j DROP",
        namespace.name
    );
    assert!(run(&drops), "{drops}");
    let spec = campaign(scale, 60, 1000);
    let mut cluster = ProcessCluster::start(0);
    // The coordinator listens only on loopback, and a namespace has a loopback of its own.
    let relay = Proxy::listening(&format!("{}.1:0", namespace.subnet), cluster.address(), 0);
    let url = relay.url();
    let _workers = [(); 2].map(|()| cluster.worker_in(&namespace.name, &url));
    let id = cluster.submit(&spec);
    let digest = cluster.finish(&id);
    let counted = Command::new("ip")
        .args(["netns", "exec", &namespace.name, "iptables", "-nvxL", "INPUT"])
        .output()
        .unwrap();
    let counted = String::from_utf8_lossy(&counted.stdout).into_owned();
    let dropped: u64 = counted
        .lines()
        .find(|line| line.contains("statistic"))
        .and_then(|line| line.split_whitespace().next()?.parse().ok())
        .unwrap_or(0);
    assert!(dropped > 0, "no packet was lost: {counted}");
    Row {
        done: format!("5 % of the packets to two workers in a network namespace dropped, {dropped} in all"),
        found: undisturbed.check(&spec, &digest),
    }
}
