//! What a user does in the window, and what commands make of the same.

use std::ffi::OsString;

use egui::Pos2;
use egui::accesskit::Role;
use egui_kittest::Node;

use super::*;

/// A window under test.
pub type Window = Harness<'static, Modeler>;

/// So high that no panel has to scroll.
pub const TALL: [f32; 2] = [1280.0, 1800.0];

/// One with nothing open.
pub fn window_of(home: &Path, size: [f32; 2]) -> Window {
    let home = home.to_path_buf();
    let made = |ui: &mut egui::Ui, modeler: &mut Modeler| modeler.show(ui);
    let context = egui::Context::default();
    Harness::builder()
        .with_size(size)
        .build_ui_state(made, Modeler::on(&context, None, home))
}

/// The same, of the usual size.
pub fn window(home: &Path) -> Window {
    window_of(home, [1280.0, 800.0])
}

/// One with a block of clay in it.
pub fn window_with_clay(home: &Path) -> Window {
    with_clay(window(home))
}

/// A window in which a block of clay is opened.
pub fn with_clay(mut window: Window) -> Window {
    window.step();
    window.get_by_label("A block of clay").click();
    wait_for(&mut window, "History");
    window
}

/// A place over the middle of what is seen.
pub fn middle(window: &Window) -> Pos2 {
    egui::pos2(620.0, 0.5 * window.ctx.content_rect().height())
}

/// Steps until something is so.
pub fn steps_until(window: &mut Window, what: &str, is: impl Fn(&Window) -> bool) {
    let start = Instant::now();
    while !is(window) {
        let bench = window.state().bench();
        assert!(
            start.elapsed() < Duration::from_secs(60),
            "not {what}: {:?} {:?}, {:?} in the hand, {:?}",
            bench.sheet,
            bench.busy,
            bench.tool.kind,
            bench.messages
        );
        std::thread::sleep(Duration::from_millis(10));
        window.step();
    }
}

/// Steps until something is there.
pub fn wait_for(window: &mut Window, what: &str) {
    steps_until(window, what, |window| window.query_by_label(what).is_some());
}

/// Steps until the desk has made something so.
pub fn until(window: &mut Window, what: &str, is: impl Fn(&Sheet) -> bool) -> Arc<Sheet> {
    let sheet = |window: &Window| window.state().bench().sheet.clone().filter(|sheet| is(sheet));
    steps_until(window, what, |window| sheet(window).is_some());
    sheet(window).unwrap()
}

/// Steps until there are so many edits.
pub fn edits(window: &mut Window, count: usize) -> Arc<Sheet> {
    until(window, "edited", |sheet| sheet.history.len() == count)
}

/// The first button of the mouse goes down or up somewhere.
pub fn button(pos: Pos2, pressed: bool) -> egui::Event {
    egui::Event::PointerButton {
        pos,
        button: egui::PointerButton::Primary,
        pressed,
        modifiers: egui::Modifiers::NONE,
    }
}

/// A click somewhere.
pub fn click(window: &mut Window, at: Pos2) {
    draw(window, &[at]);
}

/// The button goes down at the first place, over the others, and up at the last.
pub fn draw(window: &mut Window, way: &[Pos2]) {
    window.hover_at(way[0]);
    window.step();
    window.drag_at(way[0]);
    window.step();
    for at in &way[1..] {
        window.hover_at(*at);
        window.step();
    }
    window.drop_at(way[way.len() - 1]);
    window.step();
}

/// To the right over the middle of what is seen.
pub fn drag(window: &mut Window) {
    let from = middle(window);
    let way: Vec<Pos2> = (0..13).map(|n| from + egui::vec2(6.0 * n as f32, 0.0)).collect();
    draw(window, &way);
}

/// A menu, those below it after a stroke, and what is in it.
pub fn choose(window: &mut Window, menus: &str, item: &str) {
    for menu in menus.split('/') {
        window.get_by_label_contains(menu).click();
        window.run_steps(4);
    }
    window.get_by_label_contains(item).click();
    window.run_steps(2);
}

/// What the command palette finds first by some words.
pub fn command(window: &mut Window, words: &str) {
    window.key_press(egui::Key::F3);
    window.run_steps(3);
    window.event(egui::Event::Text(words.into()));
    window.run_steps(2);
    window.key_press(egui::Key::Enter);
    window.run_steps(2);
}

/// Types letters, as they come from a keyboard.
pub fn types(window: &mut Window, text: &str) {
    for letter in text.chars() {
        window.event(egui::Event::Text(letter.into()));
        window.step();
    }
}

/// Clicks what has a label. What is scrolled out of sight is scrolled to: a click there would meet something else, or nothing.
pub fn press(window: &mut Window, label: &str) {
    window.get_by_label(label).scroll_to_me();
    window.run_steps(20);
    window.get_by_label(label).click();
    window.run_steps(3);
}

/// Writes into a field by its label, in place of what is there.
pub fn write(window: &mut Window, role: Role, label: &str, text: &str) {
    write_into(window, role, (label, 0), text);
}

/// The same of one of several that have the label.
fn write_into(window: &mut Window, role: Role, (label, at): (&str, usize), text: &str) {
    fn field<'w>(window: &'w Window, role: Role, label: &'w str, at: usize) -> Node<'w> {
        let mut all = window.get_all_by_role_and_label(role, label);
        all.nth(at).unwrap_or_else(|| panic!("no {label:?} {at}"))
    }
    field(window, role, label, at).scroll_to_me();
    window.run_steps(20);
    field(window, role, label, at).focus();
    field(window, role, label, at).click();
    window.run_steps(2);
    window.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
    window.step();
    field(window, role, label, at).type_text(text);
    window.step();
}

/// Types a number into the field of a label, or into one of several fields of that.
pub fn set(window: &mut Window, (label, at): (&str, usize), number: &str) {
    write_into(window, Role::SpinButton, (label, at), number);
    window.key_press(egui::Key::Enter);
    window.run_steps(2);
}

/// Commands of the line `sculpt` on a block of clay as the window makes it: the hash that they leave.
pub fn by_script(script: &str) -> [u8; 32] {
    let (name, object) = crate::cli::desk_files::clay_block().unwrap();
    let state = State::new().with(&name, object).unwrap();
    let named = |own: Option<&str>| Ok::<_, document::CommandError>(own.unwrap_or(&name).to_string());
    let commands = Command::of_script(script, named).unwrap();
    let all = commands.iter().try_fold(state, |state, command| {
        command
            .apply(&state, &mut Control::default())
            .map(|(next, _)| next)
    });
    all.unwrap().sha256()
}

/// What the command line answers.
pub fn command_line(
    subcommand: &str,
    arguments: &[&dyn AsRef<std::ffi::OsStr>],
) -> serde_json::Map<String, serde_json::Value> {
    let arguments: Vec<OsString> = arguments.iter().map(|a| a.as_ref().to_owned()).collect();
    let said = crate::cli::command_line(subcommand, arguments.into_iter());
    said.unwrap_or_else(|why| panic!("{subcommand}: {why}"))
}

/// The edits of a window, as they lie on the disk, are those of a script on a block of clay.
pub fn assert_is_script(sheet: &Sheet, scratch: &Path, lines: &[serde_json::Value]) {
    let document = on_disk(sheet, scratch);
    let script: Vec<String> = lines.iter().map(|line| line.to_string()).collect();
    let script = script.join("\n") + "\n";
    assert!(
        document.state().sha256() == by_script(&script),
        "{:?} is not {script}",
        sheet.history
    );
}
