//! OBJ and MTL files that ask for too much are refused with the line where they do, before it is given.
#![cfg(feature = "obj")]

use std::cell::Cell;
use std::fmt::Write as _;
use std::io::{self, BufRead, Read};
use std::path::Path;

use rayset_scene::{Limits, LoadOptions, ObjModel, SceneError, read_mtl, read_obj};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

fn options(change: impl Fn(&mut Limits)) -> LoadOptions {
    let mut options = LoadOptions::default();
    change(&mut options.limits);
    options
}

fn no_library(_: &Path) -> io::Result<Box<dyn BufRead>> {
    Err(io::Error::from(io::ErrorKind::NotFound))
}

fn read(text: &str, options: &LoadOptions) -> Result<ObjModel, String> {
    read_obj(text.as_bytes(), Path::new("a.obj"), options, no_library).map_err(|error| error.to_string())
}

/// A text that is repeated as often as asked, and counts the bytes taken from it.
struct Repeated<'a> {
    text: &'a [u8],
    left: u64,
    position: usize,
    taken: &'a Cell<u64>,
}

impl Read for Repeated<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.fill_buf()?.read(out)?;
        self.consume(read);
        Ok(read)
    }
}

impl BufRead for Repeated<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.position == self.text.len() && self.left > 0 {
            self.position = 0;
            self.left -= 1;
        }
        Ok(&self.text[self.position..])
    }

    fn consume(&mut self, amount: usize) {
        self.position += amount;
        self.taken.set(self.taken.get() + amount as u64);
    }
}

#[test]
fn limits_are_the_greatest_that_load() {
    let face = format!("{TRIANGLE}f 1 2 3\nf 1 2 3\n");
    assert!(read(&face, &options(|limits| limits.faces = 2)).is_ok());
    assert_eq!(read(&face, &options(|limits| limits.faces = 1)).unwrap_err(), "a.obj:5: more than 1 faces");
    let polygon = format!("{TRIANGLE}v 0 0 1\nf 1 2 3 4\n");
    assert!(read(&polygon, &options(|limits| limits.corners = 4)).is_ok());
    assert_eq!(
        read(&polygon, &options(|limits| limits.corners = 3)).unwrap_err(),
        "a.obj:5: a face has more than 3 corners"
    );
    let line = format!("{TRIANGLE}# 34567890\nf 1 2 3\n");
    assert!(read(&line, &options(|limits| limits.line_bytes = 10)).is_ok());
    assert_eq!(
        read(&line, &options(|limits| limits.line_bytes = 9)).unwrap_err(),
        "a.obj:4: the line is longer than 9 bytes"
    );
}

#[test]
fn continued_line_is_as_long_as_its_parts() {
    let text = format!("{TRIANGLE}f 1 \\\n2 \\\n3\n");
    assert!(read(&text, &options(|limits| limits.line_bytes = 10)).is_ok());
    assert_eq!(
        read(&text, &options(|limits| limits.line_bytes = 8)).unwrap_err(),
        "a.obj:4: the line is longer than 8 bytes"
    );
    let taken = Cell::new(0);
    let endless = Repeated { text: b"\\\n", left: u64::MAX, position: 0, taken: &taken };
    let limited = options(|limits| limits.line_bytes = 1000);
    let error = read_obj(endless, Path::new("a.obj"), &limited, no_library).unwrap_err();
    assert_eq!(error.to_string(), "a.obj:1: the line is longer than 1000 bytes");
    assert!(taken.get() < 10_000);
}

#[test]
fn endless_line_is_refused_before_it_is_held() {
    for text in [&b"\0\0\0\0"[..], b" ", b"1 ", b"#"] {
        let taken = Cell::new(0);
        let endless = Repeated { text, left: u64::MAX, position: 0, taken: &taken };
        let error = read_obj(endless, Path::new("zero"), &LoadOptions::default(), no_library).unwrap_err();
        assert_eq!(error.to_string(), "zero:1: the line is longer than 1048576 bytes");
        assert!(taken.get() <= 1 << 20);
    }
}

#[test]
fn million_faces_are_counted_and_then_refused() {
    let taken = Cell::new(0);
    let many = || {
        TRIANGLE.as_bytes().chain(Repeated {
            text: b"f 1 2 3\n",
            left: 1_000_000,
            position: 0,
            taken: &taken,
        })
    };
    let limited = options(|limits| limits.faces = 999_999);
    let error = read_obj(many(), Path::new("a.obj"), &limited, no_library).unwrap_err();
    assert_eq!(error.to_string(), "a.obj:1000003: more than 999999 faces");
    let limited = options(|limits| limits.memory_bytes = 10 << 20);
    taken.set(0);
    let error = read_obj(many(), Path::new("a.obj"), &limited, no_library).unwrap_err().to_string();
    assert!(error.ends_with(": the scene would take more than 10485760 bytes of memory"), "{error}");
    assert!(taken.get() < 1 << 20, "{} bytes were read", taken.get());
}

#[test]
fn everything_that_is_held_takes_memory() {
    let limited = options(|limits| limits.memory_bytes = 1 << 20);
    let name = "n".repeat(1000);
    let two_groups = format!("g {name}\nf 1 2 3\ng\nf 1 2 3\n");
    for (what, text) in [
        ("vertices", "v 0 0 0\n"),
        ("normals", "vn 0 0 1\n"),
        ("corners", "f 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1\n"),
        ("groups", two_groups.as_str()),
    ] {
        let taken = Cell::new(0);
        let many = TRIANGLE.as_bytes().chain(Repeated {
            text: text.as_bytes(),
            left: 1 << 30,
            position: 0,
            taken: &taken,
        });
        let error = read_obj(many, Path::new("a.obj"), &limited, no_library).unwrap_err().to_string();
        assert!(error.contains("1048576 bytes of memory"), "{what}: {error}");
        assert!(taken.get() < 2 << 20, "{what}: {} bytes were read", taken.get());
    }
    for (what, statement) in [("libraries", "mtllib "), ("materials", "usemtl ")] {
        let text: String = (0..20_000).fold(String::new(), |mut text, i| {
            writeln!(text, "{statement}{i}").unwrap();
            text
        });
        assert!(read(&text, &limited).unwrap_err().contains("1048576 bytes of memory"), "{what}");
    }
    let taken = Cell::new(0);
    let many = Repeated { text: b"newmtl a\n", left: 1 << 30, position: 0, taken: &taken };
    let error = read_mtl(many, Path::new("a.mtl"), &limited).unwrap_err().to_string();
    assert!(error.contains("1048576 bytes of memory"), "{error}");
}

#[test]
fn library_is_read_up_to_its_limit() {
    let text = "newmtl a\nKd 1 0 0\nnewmtl b\n";
    let limited = |bytes| options(move |limits| limits.library_bytes = bytes);
    let length = text.len() as u64;
    assert_eq!(read_mtl(text.as_bytes(), Path::new("a.mtl"), &limited(length)).unwrap().materials.len(), 2);
    let error = read_mtl(text.as_bytes(), Path::new("a.mtl"), &limited(length - 1)).unwrap_err();
    assert_eq!(error.to_string(), "a.mtl:3: the library is longer than 26 bytes");
    let taken = Cell::new(0);
    let endless = || Repeated { text: b"# and so on\n", left: u64::MAX, position: 0, taken: &taken };
    let error = read_mtl(endless(), Path::new("a.mtl"), &limited(1000)).unwrap_err();
    assert!(error.to_string().contains("longer than 1000 bytes"), "{error}");
    assert!(taken.get() <= 1001);
    // An OBJ file that names the library fails with the line of the library.
    let obj = format!("mtllib a.mtl\n{TRIANGLE}f 1 2 3\n");
    let library = |_: &Path| Ok(Box::new(text.as_bytes()) as Box<dyn BufRead>);
    let error = read_obj(obj.as_bytes(), Path::new("b/a.obj"), &limited(8), library).unwrap_err();
    assert_eq!(error.to_string(), "b/a.mtl:1: the library is longer than 8 bytes");
    assert!(limited(u64::MAX).limits.library_bytes == u64::MAX && read(&obj, &limited(u64::MAX)).is_ok());
}

#[test]
fn warnings_are_counted_beyond_the_first() {
    let text = format!("{TRIANGLE}f 1 2 3\n{}", "l 1 2\n".repeat(100_000));
    let warnings = read(&text, &LoadOptions::default()).unwrap().warnings;
    assert_eq!(warnings.len(), 101);
    assert_eq!(warnings[99].to_string(), "a.obj:104: `l` ignored: only faces are read");
    assert_eq!(warnings[100].to_string(), "a.obj: 99900 further warnings are not shown");
    let none = read(&text, &options(|limits| limits.warnings = 0)).unwrap().warnings;
    assert_eq!(none.len(), 1);
    let mtl =
        read_mtl("newmtl a\nKd x\nKd x\n".as_bytes(), Path::new("a"), &options(|l| l.warnings = 1)).unwrap();
    assert_eq!(mtl.warnings.len(), 2);
}

#[test]
fn library_is_asked_for_once_by_each_name() {
    let asked = std::cell::RefCell::new(Vec::new());
    let obj =
        format!("{}{TRIANGLE}f 1 2 3\n", "mtllib a.mtl\nmtllib ./a.mtl\nmtllib b.mtl c d.mtl\n".repeat(1000));
    let model = read_obj(obj.as_bytes(), Path::new("a.obj"), &LoadOptions::default(), |name| {
        asked.borrow_mut().push(name.to_str().unwrap().to_owned());
        match name.to_str() {
            Some("a.mtl" | "d.mtl") => Ok(Box::new(&b"newmtl red\n"[..])),
            _ => Err(io::Error::other("it is forbidden")),
        }
    })
    .unwrap();
    assert_eq!(*asked.borrow(), ["a.mtl", "b.mtl c d.mtl", "b.mtl", "c", "d.mtl"]);
    let warnings: Vec<_> = model.warnings.iter().map(ToString::to_string).collect();
    assert_eq!(
        warnings,
        [
            "d.mtl:1: material `red` is defined again: from here on this one is meant",
            "a.obj:3: library `b.mtl` ignored: it is forbidden",
            "a.obj:3: library `c` ignored: it is forbidden",
        ]
    );
}

#[test]
fn reader_that_fails_is_an_error_with_its_file() {
    struct Broken;
    impl Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Err(io::Error::other("broken"))
        }
    }
    let broken = || io::BufReader::new(TRIANGLE.as_bytes().chain(Broken));
    let error = read_obj(broken(), Path::new("a.obj"), &LoadOptions::default(), no_library).unwrap_err();
    assert!(matches!(&error, SceneError::Read { path, .. } if path == Path::new("a.obj")), "{error}");
    let obj = format!("mtllib a.mtl\n{TRIANGLE}f 1 2 3\n");
    let library = |_: &Path| Ok(Box::new(io::BufReader::new(Broken)) as Box<dyn BufRead>);
    let error = read_obj(obj.as_bytes(), Path::new("a.obj"), &LoadOptions::default(), library).unwrap_err();
    assert!(matches!(&error, SceneError::Read { path, .. } if path == Path::new("a.mtl")), "{error}");
}
