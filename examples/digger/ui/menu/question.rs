//! The page that asks before something is lost, and says why something can't be done.

use std::sync::Arc;

use bevy::prelude::*;

use super::spawn_page;
use crate::player::game_state::MenuPage;
use crate::ui::texts;
use crate::ui::widgets::{self, Activated, WHITE};

const WIDTH: f32 = 460.0;

/// Asks questions.
pub struct QuestionPlugin;

impl Plugin for QuestionPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(MenuPage::Question), open);
    }
}

/// What is asked now.
#[derive(Resource, Clone)]
pub struct Question {
    text: String,
    /// The label of the answer that does it, and what it does; `None` if there is nothing to decide.
    yes: Option<(&'static str, Arc<dyn Fn(&mut Commands) + Send + Sync>)>,
    /// The page on which it was asked.
    pub back: MenuPage,
}

/// Opens the page, and does something if the player says so. Cancelling is the first answer, so that no key pressed
/// twice loses anything.
pub fn ask(
    commands: &mut Commands,
    back: MenuPage,
    text: impl Into<String>,
    yes: &'static str,
    action: impl Fn(&mut Commands) + Send + Sync + 'static,
) {
    commands.insert_resource(Question { text: text.into(), yes: Some((yes, Arc::new(action))), back });
    commands.set_state(MenuPage::Question);
}

/// Opens the page with a text that the player should not miss, and leads back.
pub fn tell(commands: &mut Commands, back: MenuPage, text: impl Into<String>) {
    commands.insert_resource(Question { text: text.into(), yes: None, back });
    commands.set_state(MenuPage::Question);
}

fn open(mut commands: Commands, question: Option<Res<Question>>) {
    let Some(question) = question.as_deref().cloned() else { return };
    let (title, back) = match question.yes {
        Some(_) => (texts::SURE, texts::CANCEL),
        None => (texts::NOT_POSSIBLE, texts::BACK),
    };
    spawn_page(&mut commands, MenuPage::Question, title, WIDTH + 54.0, |column| {
        let line = Node { width: px(WIDTH), margin: UiRect::bottom(px(14)), ..default() };
        // Paths may be longer than a line.
        let layout = TextLayout::linebreak(LineBreak::WordOrCharacter);
        column.spawn((widgets::paragraph(&question.text, 18.0, WHITE), layout, line));
        column.spawn(widgets::button(0, back, WIDTH)).observe(super::go_to(question.back));
        let Some((yes, action)) = question.yes else { return };
        column.spawn(widgets::button(1, yes, WIDTH)).observe(
            move |_: On<Activated>, mut commands: Commands| {
                commands.set_state(question.back);
                action(&mut commands);
            },
        );
    });
}
