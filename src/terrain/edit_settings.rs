//! What edits obey in addition to their own brushes.

use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::order::Order;
use crate::loose::LooseSettings;
use crate::volume::DiggingRules;

/// The rules and the search for loose pieces that edits obey, fixed when an edit is submitted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EditSettings {
    /// The rules; `None` if there are none.
    #[serde(serialize_with = "write_rules", deserialize_with = "read_rules")]
    pub rules: Option<Arc<DiggingRules>>,
    /// The search for loose pieces; `None` if there is none.
    pub loose: Option<LooseSettings>,
}

impl EditSettings {
    /// Whether they are equal and share their rules. Equal rules in two allocations are not the same.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        let has_same_rules = match (&self.rules, &other.rules) {
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            (own, other) => own.is_none() && other.is_none(),
        };
        has_same_rules && self.loose == other.loose
    }

    /// The orders that set what differs from earlier settings; without any, all of them.
    pub(crate) fn orders_after(&self, before: Option<&Self>) -> impl Iterator<Item = Order> + use<> {
        let rules =
            before.is_none_or(|before| before.rules != self.rules).then(|| Order::Rules(self.rules.clone()));
        let loose = before.is_none_or(|before| before.loose != self.loose);
        rules.into_iter().chain(loose.then_some(Order::Loose(self.loose)))
    }
}

fn write_rules<S: Serializer>(rules: &Option<Arc<DiggingRules>>, to: S) -> Result<S::Ok, S::Error> {
    rules.as_deref().serialize(to)
}

fn read_rules<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Arc<DiggingRules>>, D::Error> {
    Ok(Option::<DiggingRules>::deserialize(from)?.map(Arc::new))
}
