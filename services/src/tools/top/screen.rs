//! The terminal of `top`: full screen, given back as it was.

use core::time::Duration;

use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::Line;
use ratatui::widgets::{Paragraph, Row, Table};
use ratatui::{DefaultTerminal, Frame};

use super::tables::{
    LEGEND, PROCESS_HEADER, PROCESS_WIDTHS, TOPIC_HEADER, TOPIC_WIDTHS, headline, process, remarks,
    topic,
};
use super::watch::Snapshot;
use crate::exit::Failure;

/// What a person wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// To see on.
    Nothing,
    /// To see it all anew: the terminal has another size.
    Redraw,
    /// To leave.
    Quit,
}

/// The terminal while `top` has it.
#[derive(Debug)]
pub struct Screen {
    terminal: DefaultTerminal,
    shown: Option<Snapshot>,
}

impl Screen {
    /// Takes the terminal.
    ///
    /// # Errors
    /// [`Failure`] where it cannot be taken.
    pub fn open() -> Result<Self, Failure> {
        Ok(Self { terminal: ratatui::try_init().map_err(unusable)?, shown: None })
    }

    /// What was typed since the last look.
    ///
    /// # Errors
    /// [`Failure`] where the terminal broke.
    pub fn wish(&self) -> Result<Wish, Failure> {
        let mut wish = Wish::Nothing;
        while event::poll(Duration::ZERO).map_err(unusable)? {
            match wish_of(&event::read().map_err(unusable)?) {
                Wish::Quit => return Ok(Wish::Quit),
                Wish::Redraw => wish = Wish::Redraw,
                Wish::Nothing => {}
            }
        }
        Ok(wish)
    }

    /// Shows a snapshot.
    ///
    /// # Errors
    /// [`Failure`] where the terminal broke.
    pub fn draw(&mut self, snapshot: Snapshot) -> Result<(), Failure> {
        self.shown = Some(snapshot);
        self.draw_again()
    }

    /// Shows the newest snapshot once more.
    ///
    /// # Errors
    /// [`Failure`] where the terminal broke.
    pub fn draw_again(&mut self) -> Result<(), Failure> {
        let Some(snapshot) = &self.shown else { return Ok(()) };
        self.terminal.draw(|frame| draw(frame, snapshot)).map(|_| ()).map_err(unusable)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

fn unusable(error: std::io::Error) -> Failure {
    Failure::unavailable(format!("terminal: {error}"))
}

fn wish_of(event: &Event) -> Wish {
    match event {
        Event::Key(key) if key.kind == KeyEventKind::Press => match key.code {
            KeyCode::Char('q') | KeyCode::Esc => Wish::Quit,
            // The terminal hands Ctrl-C over as a key.
            KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => Wish::Quit,
            _ => Wish::Nothing,
        },
        Event::Resize(..) => Wish::Redraw,
        _ => Wish::Nothing,
    }
}

fn draw(frame: &mut Frame<'_>, snapshot: &Snapshot) {
    let rows = |count: usize| u16::try_from(count + 1).unwrap_or(u16::MAX);
    let areas = Layout::vertical([
        Constraint::Length(2),
        Constraint::Length(rows(snapshot.processes.len()) + 1),
        Constraint::Length(rows(snapshot.topics.len()) + 1),
        Constraint::Min(0),
        Constraint::Length(1),
    ])
    .split(frame.area());
    let bold = Style::new().add_modifier(Modifier::BOLD);
    frame.render_widget(Paragraph::new(headline(snapshot)).style(bold), areas[0]);
    let processes = snapshot.processes.iter().map(|line| {
        let healthy = matches!(line.state, "healthy" | "alive" | "external");
        let style = if healthy { Style::new() } else { Style::new().fg(Color::Red) };
        Row::new(cells(process(line), &[0, 2])).style(style)
    });
    let header = Row::new(cells(PROCESS_HEADER.map(str::to_owned), &[0, 2])).style(bold);
    frame.render_widget(Table::new(processes, PROCESS_WIDTHS).header(header), areas[1]);
    let topics = snapshot.topics.iter().map(|line| {
        let style = if line.refused > 0 { Style::new().fg(Color::Red) } else { Style::new() };
        Row::new(cells(topic(line), &[0, 1])).style(style)
    });
    let header = Row::new(cells(TOPIC_HEADER.map(str::to_owned), &[0, 1])).style(bold);
    frame.render_widget(Table::new(topics, TOPIC_WIDTHS).header(header), areas[2]);
    let remarks: Vec<_> = remarks(snapshot).into_iter().map(Line::from).collect();
    frame.render_widget(Paragraph::new(remarks), areas[3]);
    frame.render_widget(Paragraph::new(format!("q quits; {LEGEND}")), areas[4]);
}

/// Cells of a row: names to the left, numbers to the right.
fn cells<const N: usize>(words: [String; N], names: &[usize]) -> Vec<Line<'static>> {
    let aligned = |(index, word): (usize, String)| {
        let line = Line::from(word);
        if names.contains(&index) { line } else { line.right_aligned() }
    };
    words.into_iter().enumerate().map(aligned).collect()
}

#[cfg(test)]
mod tests {
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use ratatui::crossterm::event::KeyEvent;

    use super::super::tables::tests::crowded;
    use super::*;

    fn shown(columns: u16, lines: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(columns, lines)).unwrap();
        terminal.draw(|frame| draw(frame, &crowded())).unwrap();
        terminal.backend().to_string()
    }

    #[test]
    fn a_terminal_of_80_columns_shows_all_of_it() {
        let screen = shown(80, 40);
        for words in [
            "instance one, faulted: process died: tracker",
            "4194304",
            "given up",
            "1024",
            "199.9",
            "1000000",
            "layout version 2",
            "q quits",
        ] {
            assert!(screen.contains(words), "{words}:\n{screen}");
        }
    }

    #[test]
    fn a_tiny_terminal_is_no_failure() {
        assert!(shown(20, 5).contains("instance one"));
        assert!(!shown(1, 1).is_empty());
    }

    #[test]
    fn q_escape_and_ctrl_c_quit() {
        let key = |code, modifiers| wish_of(&Event::Key(KeyEvent::new(code, modifiers)));
        assert_eq!(key(KeyCode::Char('q'), KeyModifiers::NONE), Wish::Quit);
        assert_eq!(key(KeyCode::Esc, KeyModifiers::NONE), Wish::Quit);
        assert_eq!(key(KeyCode::Char('c'), KeyModifiers::CONTROL), Wish::Quit);
        assert_eq!(key(KeyCode::Char('c'), KeyModifiers::NONE), Wish::Nothing);
        assert_eq!(wish_of(&Event::Resize(9, 9)), Wish::Redraw);
    }
}
