//! Chromium without a window, driven through its DevTools protocol over a pipe: keys and pointers arrive as a user's do.
//!
//! Messages are JSON that ends in a zero byte. The browser reads them from descriptor 3 and writes to 4, where a shell puts its own input and output.
#![allow(dead_code, reason = "each file of tests has needs of its own")]

pub mod made;

use base64::{Engine, engine::general_purpose::STANDARD};
use libtest_mimic::Failed;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use std::{env, thread};
use tempfile::TempDir;

const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

const FLAGS: [&str; 11] = [
    "--headless=new",
    "--remote-debugging-pipe",
    "--no-sandbox",
    "--no-first-run",
    "--disable-quic",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--force-color-profile=srgb",
];

/// No device is needed to show a page.
const WITHOUT_DEVICE: [&str; 1] = ["--disable-gpu"];

/// Software will do, which is not offered to pages without being asked for.
const WITH_DEVICE: [&str; 1] = ["--enable-unsafe-webgpu"];

type Outcome = Result<(), Failed>;

/// How long an answer may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

pub fn find() -> Option<PathBuf> {
    let folders: Vec<PathBuf> = env::split_paths(&env::var_os("PATH")?).collect();
    NAMES.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name))).find(|path| path.is_file())
}

/// A browser with one page open.
pub struct Browser {
    process: Child,
    input: ChildStdin,
    messages: Receiver<Value>,
    events: Vec<Value>,
    session: Option<String>,
    calls: u64,
    _profile: TempDir,
}

impl Browser {
    pub fn start() -> Result<Self, Failed> {
        Self::with(&WITHOUT_DEVICE)
    }

    /// One that offers WebGPU to its pages.
    pub fn with_webgpu() -> Result<Self, Failed> {
        Self::with(&WITH_DEVICE)
    }

    fn with(flags: &[&str]) -> Result<Self, Failed> {
        let profile = tempfile::tempdir()?;
        let program = find().ok_or("no browser")?;
        let mut process = Command::new("sh")
            .args(["-c", "exec \"$@\" 3<&0 4>&1 </dev/null >/dev/null 2>&1", "sh"])
            .arg(program)
            .args(FLAGS)
            .args(flags)
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let input = process.stdin.take().ok_or("no pipe to the browser")?;
        let messages = listen(process.stdout.take().ok_or("no pipe from the browser")?);
        let mut browser = Self { process, input, messages, events: Vec::new(), session: None, calls: 0, _profile: profile };
        let target = browser.call("Target.createTarget", json!({"url": "about:blank"}))?["targetId"].clone();
        let attached = browser.call("Target.attachToTarget", json!({"targetId": target, "flatten": true}))?;
        browser.session = attached["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.call(&format!("{domain}.enable"), json!({}))?;
        }
        Ok(browser)
    }

    fn call(&mut self, method: &str, params: Value) -> Result<Value, Failed> {
        self.calls += 1;
        let id = self.calls;
        let mut message = json!({"id": id, "method": method, "params": params});
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        self.input.write_all(format!("{message}\0").as_bytes())?;
        self.input.flush()?;
        let answer = self.wait(|message| message["id"] == id, method)?;
        if answer["error"].is_null() { Ok(answer["result"].clone()) } else { Err(format!("{method}: {}", answer["error"]).into()) }
    }

    /// The first message that fits; events before it are kept.
    fn wait(&mut self, fits: impl Fn(&Value) -> bool, what: &str) -> Result<Value, Failed> {
        let end = Instant::now() + PATIENCE;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let message = self.messages.recv_timeout(left).map_err(|error| format!("{what}: the browser says nothing: {error}"))?;
            if fits(&message) {
                return Ok(message);
            }
            self.events.push(message);
        }
    }

    /// Opens a file and waits until it is loaded.
    pub fn open(&mut self, file: &Path) -> Outcome {
        self.navigate(&format!("file://{}", file.display()))
    }

    /// The same at a place within it, which the page finds behind `#`.
    pub fn open_at(&mut self, file: &Path, place: &str) -> Outcome {
        self.navigate(&format!("file://{}#{place}", file.display()))
    }

    fn navigate(&mut self, address: &str) -> Outcome {
        self.events.clear();
        self.call("Page.navigate", json!({"url": address}))?;
        if !self.events.iter().any(|event| event["method"] == "Page.loadEventFired") {
            self.wait(|message| message["method"] == "Page.loadEventFired", "loading")?;
        }
        Ok(())
    }

    /// Width and height of the window [CSS pixels], and whether it is a phone's.
    pub fn resize(&mut self, [width, height]: [u32; 2], mobile: bool) -> Outcome {
        self.call("Emulation.setDeviceMetricsOverride", json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": mobile}))?;
        self.call("Emulation.setTouchEmulationEnabled", json!({"enabled": mobile})).map(|_| ())
    }

    /// `light` or `dark`.
    pub fn prefer(&mut self, scheme: &str) -> Outcome {
        self.call("Emulation.setEmulatedMedia", json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]})).map(|_| ())
    }

    /// The value of an expression of JavaScript, awaited.
    pub fn evaluate(&mut self, expression: &str) -> Result<Value, Failed> {
        let result = self.call("Runtime.evaluate", json!({"expression": expression, "returnByValue": true, "awaitPromise": true}))?;
        if result["exceptionDetails"].is_null() {
            Ok(result["result"]["value"].clone())
        } else {
            Err(format!("{expression}: {}", result["exceptionDetails"]).into())
        }
    }

    /// Begins what an expression of JavaScript does, and does not wait for its end.
    pub fn begin(&mut self, expression: &str) -> Outcome {
        self.evaluate(&format!("{{ {expression}; }} 0")).map(|_| ())
    }

    /// Waits until an expression is true.
    pub fn until(&mut self, expression: &str) -> Outcome {
        let end = Instant::now() + PATIENCE;
        while self.evaluate(expression)? != true {
            if Instant::now() > end {
                return Err(format!("never true: {expression}\n{}", self.complaints()?.join("\n")).into());
            }
            thread::sleep(Duration::from_millis(20));
        }
        Ok(())
    }

    /// Presses and lets go of a key: `f`, `ArrowLeft`.
    pub fn key(&mut self, key: &str) -> Outcome {
        let mut down = json!({"type": "keyDown", "key": key});
        match key {
            "Enter" => down["text"] = json!("\r"),
            character if character.chars().count() == 1 => down["text"] = json!(character),
            _ => {}
        }
        self.call("Input.dispatchKeyEvent", down)?;
        self.call("Input.dispatchKeyEvent", json!({"type": "keyUp", "key": key})).map(|_| ())
    }

    /// Waits until the window has drawn what was asked of it, a change of its size too.
    fn settle(&mut self) -> Outcome {
        self.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))").map(|_| ())
    }

    /// The middle of an element, once it is in view.
    pub fn middle(&mut self, selector: &str) -> Result<[f64; 2], Failed> {
        self.settle()?;
        let script = format!(
            "(() => {{ const element = document.querySelector({}); element.scrollIntoView({{ block: 'center', inline: 'center' }}); \
             const box = element.getBoundingClientRect(); return [box.left + box.width / 2, box.top + box.height / 2]; }})()",
            json!(selector)
        );
        let point = self.evaluate(&script)?;
        point[0].as_f64().zip(point[1].as_f64()).map(|(x, y)| [x, y]).ok_or_else(|| format!("{selector}: no place").into())
    }

    pub fn click(&mut self, selector: &str) -> Outcome {
        let point = self.middle(selector)?;
        self.drag(point, point)
    }

    /// Presses the pointer at one place of the window, moves it, lets go at the other.
    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2]) -> Outcome {
        let steps = [("mouseMoved", from, 0), ("mousePressed", from, 1), ("mouseMoved", to, 1), ("mouseReleased", to, 0)];
        for (kind, [x, y], buttons) in steps {
            self.call("Input.dispatchMouseEvent", json!({"type": kind, "x": x, "y": y, "button": "left", "buttons": buttons, "clickCount": 1}))?;
        }
        Ok(())
    }

    /// Puts fingers on the screen at the first places, moves each to its last, lifts them.
    pub fn touch(&mut self, fingers: &[[[f64; 2]; 2]]) -> Outcome {
        let points = |share: f64| -> Vec<Value> {
            let place = |[from, to]: [[f64; 2]; 2], axis: usize| from[axis] + share * (to[axis] - from[axis]);
            fingers.iter().enumerate().map(|(id, finger)| json!({"id": id, "x": place(*finger, 0), "y": place(*finger, 1)})).collect()
        };
        self.call("Input.dispatchTouchEvent", json!({"type": "touchStart", "touchPoints": points(0.0)}))?;
        for share in [0.25, 0.5, 0.75, 1.0] {
            self.call("Input.dispatchTouchEvent", json!({"type": "touchMove", "touchPoints": points(share)}))?;
        }
        self.call("Input.dispatchTouchEvent", json!({"type": "touchEnd", "touchPoints": []})).map(|_| ())
    }

    /// What the window shows, once it has drawn.
    pub fn screenshot(&mut self) -> Result<image::RgbImage, Failed> {
        self.settle()?;
        let answer = self.call("Page.captureScreenshot", json!({"format": "png"}))?;
        let bytes = STANDARD.decode(answer["data"].as_str().unwrap_or_default())?;
        Ok(image::load_from_memory(&bytes)?.into_rgb8())
    }

    /// Errors of scripts and of the page, and whatever it asked the network for, since it was opened.
    pub fn complaints(&mut self) -> Result<Vec<String>, Failed> {
        // What was said before the answer comes before it.
        self.evaluate("0")?;
        Ok(self.events.iter().filter(|event| is_complaint(event)).map(Value::to_string).collect())
    }
}

fn is_complaint(event: &Value) -> bool {
    let params = &event["params"];
    match event["method"].as_str().unwrap_or_default() {
        "Runtime.exceptionThrown" => true,
        "Runtime.consoleAPICalled" => ["error", "warning", "assert"].iter().any(|kind| params["type"] == *kind),
        "Log.entryAdded" => ["error", "warning"].iter().any(|level| params["entry"]["level"] == *level),
        "Network.requestWillBeSent" => !["file:", "data:"].iter().any(|kind| params["request"]["url"].as_str().is_some_and(|url| url.starts_with(kind))),
        _ => false,
    }
}

fn listen(output: impl std::io::Read + Send + 'static) -> Receiver<Value> {
    let (sender, receiver) = channel();
    thread::spawn(move || {
        for message in BufReader::new(output).split(0).map_while(Result::ok) {
            let Ok(message) = serde_json::from_slice(&message) else { return };
            if sender.send(message).is_err() {
                return;
            }
        }
    });
    receiver
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It closes by itself when asked; what is left is ended, so that its folder can go.
        let _ = self.call("Browser.close", json!({}));
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
