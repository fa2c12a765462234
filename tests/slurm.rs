//! A real scheduler on this machine: an array of eight tasks on two nodes, of which one is killed half way.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Daemons of this test, stopped when dropped.
struct Cluster {
    folder: PathBuf,
    daemons: Vec<(String, Child)>,
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for (_, daemon) in &mut self.daemons {
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

fn port() -> u16 {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    listener.local_addr().expect("address").port()
}

impl Cluster {
    /// Two nodes on the loopback; `None`, with words, where Slurm is not installed or cannot be started.
    fn new(folder: &Path) -> Option<Self> {
        let installed = |name: &str| ["/usr/sbin", "/usr/bin"].iter().any(|at| Path::new(at).join(name).exists());
        let missing = ["munged", "slurmctld", "slurmd", "sbatch", "setpriv"].into_iter().find(|name| !installed(name));
        if let Some(name) = missing {
            println!("did not run: {name} is not installed (slurm-wlm, munge)");
            return None;
        }
        if Command::new("id").arg("-u").output().ok()?.stdout != b"0\n" {
            println!("did not run: Slurm's daemons need root");
            return None;
        }
        let munge = folder.join("munge");
        for inner in ["munge", "state"] {
            fs::create_dir(folder.join(inner)).expect("folder");
        }
        fs::write(munge.join("key"), [0x5a; 1024]).expect("key");
        // The folder of temporary files may be closed to other users.
        for (mode, path) in [("0755", folder), ("0755", &munge), ("0400", &munge.join("key"))] {
            Command::new("chmod").arg(mode).arg(path).status().expect("chmod");
        }
        Command::new("chown").args(["-R", "munge"]).arg(&munge).status().expect("chown");
        let at = folder.display();
        let [control, first, second] = [port(), port(), port()];
        let text = format!(
            "ClusterName=plate\nSlurmctldHost=localhost(127.0.0.1)\nSlurmUser=root\nSlurmdUser=root\nAuthType=auth/munge\n\
             AuthInfo=socket={at}/munge/socket\nCredType=cred/munge\nProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\n\
             JobAcctGatherType=jobacct_gather/none\nAccountingStorageType=accounting_storage/none\n\
             SelectType=select/cons_tres\nSelectTypeParameters=CR_CPU\nMpiDefault=none\nSlurmctldPort={control}\n\
             StateSaveLocation={at}/state\nSlurmdSpoolDir={at}/%n\nSlurmctldPidFile={at}/control.pid\n\
             SlurmdPidFile={at}/%n.pid\nSlurmctldLogFile={at}/control.log\nSlurmdLogFile={at}/%n.log\nSlurmdTimeout=10\n\
             ReturnToService=2\nSchedulerParameters=sched_interval=1,bf_interval=1\n\
             NodeName=n1 NodeHostname=localhost NodeAddr=127.0.0.1 Port={first} CPUs=1\n\
             NodeName=n2 NodeHostname=localhost NodeAddr=127.0.0.1 Port={second} CPUs=1\n\
             PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP\n"
        );
        fs::write(folder.join("slurm.conf"), text).expect("configuration");
        let mut cluster = Self { folder: folder.to_path_buf(), daemons: Vec::new() };
        let file = |name: &str| munge.join(name).display().to_string();
        let user = ["--reuid=munge", "--regid=munge", "--init-groups", "munged", "--foreground", "--force"];
        let files = ["socket", "key-file", "log-file", "pid-file", "seed-file"];
        let names = ["socket", "key", "log", "pid", "seed"];
        let flags = files.iter().zip(names).map(|(flag, name)| format!("--{flag}={}", file(name)));
        cluster.start("munged", Command::new("setpriv").args(user).args(flags));
        cluster.wait("munged", || munge.join("socket").exists())?;
        let configuration = folder.join("slurm.conf");
        cluster.start("control", Command::new("slurmctld").arg("-D").arg("-f").arg(&configuration));
        for node in ["n1", "n2"] {
            fs::create_dir(folder.join(node)).expect("folder");
            cluster.start(node, Command::new("slurmd").args(["-D", "-N", node, "-f"]).arg(&configuration));
        }
        let idle = || cluster.ask("sinfo", &["-h", "-o", "%T %N"]).contains("idle n[1-2]");
        cluster.wait("slurmd", idle)?;
        Some(cluster)
    }

    fn start(&mut self, name: &str, command: &mut Command) {
        let daemon = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("starts");
        self.daemons.push((name.to_owned(), daemon));
    }

    fn wait(&self, what: &str, ready: impl Fn() -> bool) -> Option<()> {
        let until = Instant::now() + Duration::from_secs(60);
        while Instant::now() < until {
            if ready() {
                return Some(());
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        println!("did not run: {what} did not come up on this machine");
        None
    }

    fn ask(&self, program: &str, arguments: &[&str]) -> String {
        let binary = Path::new(env!("CARGO_BIN_EXE_holodrive")).parent().expect("folder").display().to_string();
        let path = format!("{binary}:{}", std::env::var("PATH").unwrap_or_default());
        let out = Command::new(program)
            .args(arguments)
            .env("SLURM_CONF", self.folder.join("slurm.conf"))
            .env("PATH", path)
            .env("RAYON_NUM_THREADS", "1")
            .current_dir(&self.folder)
            .output()
            .expect("runs");
        String::from_utf8_lossy(&out.stdout).trim().to_owned()
    }

    /// Kills a node as a power cut does: its daemon, the daemon's helpers and what they run, all at once.
    fn kill(&mut self, node: &str, tasks: &[u32]) {
        let parent = |pid: u32| -> Option<u32> {
            let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
            stat.rsplit_once(") ")?.1.split(' ').nth(1)?.parse().ok()
        };
        // The helper of a task is the task's parent; it must be one of Slurm's. Helpers first: one that outlives its task
        // tells the controller that the task failed, and a failed task is not given again.
        let helpers = tasks.iter().filter_map(|&task| parent(task)).filter(|pid| {
            fs::read_to_string(format!("/proc/{pid}/comm")).is_ok_and(|name| name.starts_with("slurmstepd"))
        });
        let pids: Vec<String> = helpers.chain(tasks.iter().copied()).map(|pid| pid.to_string()).collect();
        if let Some((_, daemon)) = self.daemons.iter_mut().find(|(name, _)| name == node) {
            daemon.kill().expect("killed");
            daemon.wait().expect("ended");
        }
        let _ = Command::new("kill").arg("-9").args(&pids).output();
    }
}

/// The job script of the guide.
fn script() -> String {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/guide/plates.md")).expect("the page");
    let block = text.split("```sh slurm\n").nth(1).expect("a job script").split("```").next().expect("its end");
    // Beside what a user runs: on which node each task runs, and as which process.
    block.replace("exec ", "echo $$ > $SLURMD_NODENAME-$SLURM_ARRAY_TASK_ID.pid\nexec ")
}

#[test]
fn an_array_of_eight_with_a_node_killed_half_way_ends_in_the_same_bytes() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let Some(mut cluster) = Cluster::new(f) else { return };
    let mut cloud = String::from(
        "ply\nformat ascii 1.0\nelement vertex 40\nproperty double x\nproperty double y\nproperty double z\nend_header\n",
    );
    for i in 0..40 {
        let turn = f64::from(i) * 2.4;
        cloud += &format!("{} {} {}\n", 4e-4 * turn.cos(), 3e-4 * turn.sin(), -5e-3 - 1e-5 * f64::from(i));
    }
    fs::write(f.join("points.ply"), cloud).expect("points");
    let plate = "name = \"test\"\nsize = [1280, 1024]\npitch = \"1um\"\nwavelength = \"633nm\"\nbits = 1\ntile = 128\n\
         [reference]\nangle = [\"9.1deg\", \"0deg\"]\n[scene]\nviewer = \"30mm\"\ndistance = \"5mm\"\n\
         object_angle = [\"9.2deg\", \"9.2deg\"]\n";
    fs::write(f.join("plate.toml"), plate).expect("plate");
    fs::write(f.join("plate.sbatch"), script()).expect("script");
    let whole = cluster.ask("holodrive", &["print", "points.ply", "--plate", "plate.toml", "-o", "whole", "--json"]);
    assert!(whole.contains("\"complete\": true"), "{whole}");
    let job = cluster.ask("sbatch", &["--parsable", "plate.sbatch", "points.ply", "plate.toml", "out"]);
    assert!(job.parse::<u32>().is_ok(), "sbatch said {job}");
    let dependency = format!("--dependency=afterok:{job}");
    let check = "holodrive print verify out --json > verified.json";
    cluster.ask("sbatch", &["--parsable", &dependency, "--wrap", check]);
    // Half way: a task runs on the second node and some tiles are listed.
    let until = Instant::now() + Duration::from_secs(60);
    let running = loop {
        let tiles: usize = fs::read_dir(f.join("out/.tiles"))
            .map(|lists| {
                lists.flatten().filter_map(|l| fs::read_to_string(l.path()).ok()).map(|t| t.lines().count()).sum()
            })
            .unwrap_or(0);
        let tasks: Vec<u32> = (0..8)
            .filter_map(|i| fs::read_to_string(f.join(format!("n2-{i}.pid"))).ok()?.trim().parse().ok())
            .filter(|pid| Path::new(&format!("/proc/{pid}")).exists())
            .collect();
        if tiles >= 20 && !tasks.is_empty() {
            break tasks;
        }
        assert!(Instant::now() < until, "no task came to run on the second node");
        std::thread::sleep(Duration::from_millis(5));
    };
    cluster.kill("n2", &running);
    assert!(!f.join("out/plate.tif").exists(), "it was half way");
    let until = Instant::now() + Duration::from_secs(240);
    let mut given_again = false;
    while !f.join("verified.json").exists() || fs::read(f.join("verified.json")).expect("report").is_empty() {
        assert!(Instant::now() < until, "{}", cluster.ask("squeue", &["-o", "%i %T %R"]));
        for line in cluster.ask("squeue", &["-h", "-r", "-t", "PD", "-o", "%i %R"]).lines() {
            // Slurm waits two minutes before it gives a lost node's task to another; that is not what is tested.
            if let Some((id, reason)) = line.split_once(' ')
                && reason.contains("BeginTime")
            {
                given_again = true;
                cluster.ask("scontrol", &["update", &format!("JobId={id}"), "StartTime=now"]);
            }
        }
        std::thread::sleep(Duration::from_millis(500));
    }
    println!("a task of the killed node was given to the other: {given_again}");
    let verified = fs::read_to_string(f.join("verified.json")).expect("report");
    assert!(verified.contains("\"tiles\": 80"), "{verified}");
    for name in ["manifest.json", "plate.tif"] {
        assert!(
            fs::read(f.join("out").join(name)).expect(name) == fs::read(f.join("whole").join(name)).expect(name),
            "{name}"
        );
    }
    assert!(!f.join("out/.tiles").exists());
}
