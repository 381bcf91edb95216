//! The report in a real browser: nothing is missing, nothing is loaded, nothing sticks out, and keys work.

mod browser;

use std::fs;
use std::io::Write as _;
use std::path::Path;

use rayset_study::ReportPlan;
use serde_json::Value;

use self::browser::Browser;

/// The width of a phone.
const PHONE: u32 = 390;
const DESKTOP: u32 = 1280;

/// A report of the least that has every part.
fn report() -> String {
    let folder = tempfile::tempdir().unwrap();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    let plan =
        ReportPlan::tiny("a test".into(), folder.path().into(), folder.path().join("table1"), fixtures);
    let html = plan.html(&|_, _, _| ()).unwrap();
    // All of it is recorded now, so the same bytes come again; but for the word that Table 1 was run for the report.
    let again = plan.html(&|_, _, _| ()).unwrap();
    let note =
        "<p class=\"note\">No results of Table 1 were recorded: its quick form was run for this report.</p>";
    assert!(html.contains(note));
    assert!(again == html.replace(note, ""), "the same records, other bytes");
    let (table1, _) = html.split_once("<h2 id=\"map\"").unwrap();
    // Results from before exact strategies had their coherence noted are shown without, and the report says so.
    let path = folder.path().join("table1/table1.json");
    let text = fs::read_to_string(&path).unwrap();
    let mut earlier: Value = serde_json::from_str(&text).unwrap();
    for row in earlier["ours"].as_array_mut().unwrap() {
        row["exact"]["bundle"].as_object_mut().unwrap().remove("percent_coherent");
    }
    fs::write(&path, earlier.to_string()).unwrap();
    let note = "An earlier version recorded these results";
    assert!(!html.contains(note) && plan.html(&|_, _, _| ()).unwrap().contains(note));
    // Four rows of spheres and one of a mesh, which were recorded with the table.
    let others = fs::read_to_string(folder.path().join("table1-others.jsonl")).unwrap();
    for (name, rows, is_recorded) in
        [("bundle", 5, true), ("hierarchical", 5, true), ("coherent", 5, true), ("auto", 4, false)]
    {
        let row = format!("<th class=\"source\" scope=\"row\">{name}</th>");
        assert_eq!(table1.matches(&row).count(), rows, "{name}");
        assert_eq!(!others.contains(&format!("\"strategy\":\"{name}\"")), is_recorded, "{name}");
    }
    for (name, is_coherent) in [("bundle", true), ("coherent", true), ("hierarchical", false)] {
        assert_eq!(html.contains(&format!("<title>{name}, coherent rays: From")), is_coherent, "{name}");
        assert!(html.contains(&format!("<title>{name}, ratio of times: From")), "{name}");
    }
    html
}

/// A browser, or none and a word about it.
fn browser() -> Option<Browser> {
    let found = browser::find();
    if found.is_none() {
        assert!(
            std::env::var_os("RAYSET_REQUIRE_TOOLS").is_none(),
            "chromium is not installed, and RAYSET_REQUIRE_TOOLS forbids to skip what needs it"
        );
        // Not through `eprintln`, which is captured where tests pass.
        let _ = writeln!(std::io::stderr(), "skipped: chromium is not installed");
    }
    found.map(|program| Browser::start(&program))
}

/// Everything that is wrong with a page in windows of some widths.
fn problems(browser: &mut Browser, html: &str, widths: &[u32]) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    fs::write(&path, html).unwrap();
    let mut problems = Vec::new();
    for &width in widths {
        browser.open(&path, width);
        problems.extend(
            strings(&browser.evaluate(&LOOK.replace("WIDTH", &width.to_string())))
                .into_iter()
                .map(|text| format!("{text} at {width}")),
        );
        problems.extend(browser.complaints().into_iter().map(|text| format!("console: {text}")));
        let page = format!("file://{}", path.display());
        let requests = browser.requests().into_iter().filter(|url| *url != page);
        problems.extend(requests.map(|url| format!("request: {url}")));
    }
    problems.extend(skipping(browser));
    problems.extend(switching(browser));
    problems.extend(printing(browser));
    problems
}

/// Pictures, figures, width (`WIDTH` is that of the window), and what readers who do not see them need.
const LOOK: &str = r#"(async () => {
  const problems = [];
  const images = [...document.images];
  await Promise.all(images.map(image => image.decode().catch(() => 0)));
  if (images.length < 4) problems.push(`only ${images.length} pictures`);
  for (const image of images) {
    if (!image.complete || image.naturalWidth === 0) problems.push(`missing picture: ${image.alt}`);
    if (!image.alt) problems.push("a picture without a text");
  }
  const figures = [...document.querySelectorAll("svg")];
  if (figures.length < 10) problems.push(`only ${figures.length} figures`);
  for (const figure of figures) {
    const name = figure.querySelector("title")?.textContent;
    const box = figure.getBBox();
    if (!name) problems.push("a figure without a name");
    if (figure.childElementCount < 5 || !(box.width > 50 && box.height > 50)) problems.push(`empty figure: ${name}`);
    const view = figure.viewBox.baseVal;
    if (box.x < -1 || box.y < -1 || box.x + box.width > view.width + 1 || box.y + box.height > view.height + 1)
      problems.push(`cut figure: ${name}`);
  }
  const page = document.documentElement;
  // Not `innerWidth`: a phone zooms out to show what is too wide.
  if (page.scrollWidth > WIDTH) problems.push(`page of ${page.scrollWidth} in WIDTH`);
  if (!page.lang) problems.push("no language");
  for (const table of document.querySelectorAll("table")) {
    if (!table.caption) problems.push("a table without a caption");
    if (table.querySelector("th:not([scope])")) problems.push("a heading of a table without its scope");
    if (!table.closest("[tabindex='0']")) problems.push("a table that keys cannot scroll");
  }
  if (!document.querySelector("meta[name=viewport]")) problems.push("no viewport");
  const ids = [...document.querySelectorAll("[id]")].map(element => element.id);
  if (new Set(ids).size !== ids.length) problems.push("one id twice");
  for (const link of document.querySelectorAll("a[href^='#']"))
    if (!document.getElementById(link.hash.slice(1))) problems.push(`a link to nothing: ${link.hash}`);
  const levels = [...document.querySelectorAll("h1, h2, h3, h4, h5, h6")].map(heading => +heading.tagName[1]);
  if (levels.some((level, i) => level > (levels[i - 1] ?? 0) + 1)) problems.push("a level of headings is left out");
  return problems;
})()"#;

/// The first key reaches the link that skips to the content.
fn skipping(browser: &mut Browser) -> Vec<String> {
    browser.evaluate("document.activeElement.blur(), scrollTo(0, 0)");
    browser.press("Tab");
    let is_first = browser.evaluate("document.activeElement.matches('a.skip')") == true;
    browser.press("Enter");
    let skips = browser.evaluate("document.activeElement.id") == "main";
    if is_first && skips { Vec::new() } else { vec!["the link to the content does not work".to_owned()] }
}

/// Keys reach the switch of each gallery, show where they are, and choose every view in turn.
fn switching(browser: &mut Browser) -> Vec<String> {
    const HERE: &str = r"(() => {
      const here = document.activeElement;
      return here === document.body ? 'nothing' : here.matches('input[type=radio]') ? here.name : 'another';
    })()";
    const SHOWN: &str = r"(() => {
      const here = document.activeElement, gallery = here.closest('.gallery');
      const shown = [...gallery.querySelectorAll('.view')].filter(view => getComputedStyle(view).display !== 'none');
      const ring = [here, here.closest('label')].some(element => getComputedStyle(element).outlineStyle !== 'none');
      return { value: here.value, checked: here.checked, ring, shown: shown.map(view => view.dataset.view) };
    })()";
    let galleries =
        strings(&browser.evaluate("[...document.querySelectorAll('.gallery h3')].map(h => h.id)"));
    let mut problems = Vec::new();
    if galleries.len() < 2 {
        problems.push(format!("galleries: {galleries:?}"));
    }
    for gallery in galleries {
        let here = loop {
            browser.press("Tab");
            let here = browser.evaluate(HERE);
            if here == gallery.as_str() || here == "nothing" {
                break here;
            }
        };
        if here == "nothing" {
            problems.push(format!("keys do not reach the switch of {gallery}"));
            continue;
        }
        let views = browser.evaluate("document.getElementsByName(document.activeElement.name).length");
        for view in 0..=views.as_u64().unwrap() {
            // After the last comes the first.
            let expected = (view % views.as_u64().unwrap()).to_string();
            let state = browser.evaluate(SHOWN);
            let is_right = state["value"] == expected.as_str()
                && state["checked"] == true
                && state["ring"] == true
                && strings(&state["shown"]) == [expected.as_str()];
            if !is_right {
                problems.push(format!("{gallery}, view {expected}: {state}"));
            }
            browser.press("ArrowDown");
        }
    }
    problems
}

/// Print shows every view, and no switch.
fn printing(browser: &mut Browser) -> Vec<String> {
    browser.print(true);
    let hidden = browser.evaluate("[...document.querySelectorAll('.view')].filter(view => getComputedStyle(view).display === 'none').length");
    let switches = browser.evaluate("[...document.querySelectorAll('fieldset')].filter(set => getComputedStyle(set).display !== 'none').length");
    browser.print(false);
    let mut problems = Vec::new();
    if hidden != 0 || switches != 0 {
        problems.push(format!("print hides {hidden} views and shows {switches} switches"));
    }
    problems
}

fn strings(value: &Value) -> Vec<String> {
    value.as_array().into_iter().flatten().filter_map(Value::as_str).map(str::to_owned).collect()
}

#[test]
fn a_browser_finds_nothing_wrong_with_the_report_and_finds_what_is_damaged() {
    let html = report();
    let Some(mut browser) = browser() else { return };
    assert_eq!(problems(&mut browser, &html, &[DESKTOP, PHONE]), Vec::<String>::new());
    // The policy would stop scripts and what is loaded before they do harm; without it each must be found.
    let (before, rest) = html.split_once("<meta http-equiv").unwrap();
    let open = format!("{before}<meta data-was{rest}");
    assert_eq!(problems(&mut browser, &open, &[PHONE]), Vec::<String>::new());
    let with = |more: &str| open.replacen("</main>", &format!("{more}</main>"), 1);
    for (page, expected) in [
        (html.replacen("data:image/png;base64,iVBOR", "data:image/png;base64,iVBXX", 1), "missing picture"),
        (html.replacen("</main>", "<img alt='x' src='https://example.org/x.png'></main>", 1), "console"),
        (
            with("<script>console.error('broken')</script>"),
            "console: [{\"type\":\"string\",\"value\":\"broken\"",
        ),
        (with("<script>nonsense()</script>"), "nonsense is not defined"),
        (with("<img alt='x' src='https://example.org/x.png'>"), "request: https://example.org/x.png"),
        (with("<link rel='stylesheet' href='other.css'>"), "other.css"),
        (with("<div style='width: 500px'>wide</div>"), "page of 5"),
        (with("<svg><title>nothing</title></svg>"), "empty figure: nothing"),
        (open.replace(".gallery:has(", ".nowhere:has("), "gallery-0, view 0"),
        (open.replace("<input type=\"radio\"", "<input type=\"radio\" tabindex=\"-1\""), "keys do not reach"),
        (with("<style>* { outline: none !important }</style>"), "\"ring\":false"),
        (open.replace("@media screen", "@media all"), "print hides"),
    ] {
        let found = problems(&mut browser, &page, &[PHONE]);
        assert!(
            found.iter().any(|problem| problem.contains(expected)),
            "not found: {expected}; but {found:#?}"
        );
    }
}
