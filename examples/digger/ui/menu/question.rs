//! The page that asks before something is lost.

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
    /// The label of the answer that does it.
    yes: &'static str,
    action: Arc<dyn Fn(&mut Commands) + Send + Sync>,
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
    commands.insert_resource(Question { text: text.into(), yes, action: Arc::new(action), back });
    commands.set_state(MenuPage::Question);
}

fn open(mut commands: Commands, question: Option<Res<Question>>) {
    let Some(question) = question.as_deref().cloned() else { return };
    spawn_page(&mut commands, MenuPage::Question, texts::SURE, WIDTH + 54.0, |column| {
        let line = Node { width: px(WIDTH), margin: UiRect::bottom(px(14)), ..default() };
        column.spawn((widgets::paragraph(&question.text, 18.0, WHITE), line));
        column.spawn(widgets::button(0, texts::CANCEL, WIDTH)).observe(super::go_to(question.back));
        column.spawn(widgets::button(1, question.yes, WIDTH)).observe(
            move |_: On<Activated>, mut commands: Commands| {
                commands.set_state(question.back);
                (question.action)(&mut commands);
            },
        );
    });
}
