//! The greeting of a client, and the server's welcome.

use super::super::message::*;
use super::parts::{flag, read_rules, small};
use crate::format::bytes::{Reader, put_bytes, put_number};
use crate::format::fields::{point, put_point};
use crate::format::{FormatError, WorldId, plain};
use crate::terrain::EditSettings;

const LOG: u8 = 0;
const REGIONS: u8 = 1;
const COMPARE: u8 = 2;

pub(super) fn put_hello(to: &mut Vec<u8>, hello: &Hello) {
    put_number(to, hello.protocol.into());
    put_number(to, hello.simulation.into());
    to.extend_from_slice(&hello.ground.to_le_bytes());
    put_number(to, hello.chunk_size.into());
    put_point(to, hello.position);
    to.push(hello.epoch.is_some().into());
    hello.epoch.iter().for_each(|epoch| put_epoch(to, epoch));
}

pub(super) fn read_hello(reader: &mut Reader) -> Result<Hello, FormatError> {
    Ok(Hello {
        protocol: small(reader)?,
        simulation: small(reader)?,
        ground: u64::from_le_bytes(reader.array()?),
        chunk_size: small(reader)?,
        position: point(reader)?,
        epoch: if flag(reader)? { Some(epoch(reader)?) } else { None },
    })
}

fn put_epoch(to: &mut Vec<u8>, epoch: &Epoch) {
    to.extend_from_slice(&epoch.world.0.to_le_bytes());
    to.extend_from_slice(&epoch.run.to_le_bytes());
    put_number(to, epoch.number);
}

fn epoch(reader: &mut Reader) -> Result<Epoch, FormatError> {
    let world = WorldId(u128::from_le_bytes(reader.array()?));
    Ok(Epoch { world, run: u64::from_le_bytes(reader.array()?), number: reader.number()? })
}

pub(super) fn put_welcome(to: &mut Vec<u8>, welcome: &Welcome) {
    put_number(to, welcome.client.0);
    put_epoch(to, &welcome.epoch);
    put_number(to, welcome.sequence);
    put_number(to, welcome.left);
    // No distance is as great as `u32::MAX + 1`.
    put_number(to, welcome.reach.map_or(0, |reach| u64::from(reach) + 1));
    welcome.cost.iter().for_each(|&number| put_number(to, number));
    match &welcome.join {
        Join::Log { failed } => {
            to.push(LOG);
            put_number(to, failed.len() as u64);
            let mut last = 0;
            for &number in failed {
                put_number(to, number.wrapping_sub(last));
                last = number;
            }
        }
        Join::Regions { regions, state } => {
            to.push(REGIONS);
            put_number(to, (*regions).into());
            put_rule_state(to, state);
        }
        Join::Compare { state } => {
            to.push(COMPARE);
            put_rule_state(to, state);
        }
    }
}

pub(super) fn read_welcome(reader: &mut Reader) -> Result<Welcome, FormatError> {
    let (client, epoch) = (ClientId(reader.number()?), epoch(reader)?);
    let (sequence, left) = (reader.number()?, reader.number()?);
    let reach = match reader.number()? {
        0 => None,
        more => Some(u32::try_from(more - 1).map_err(|_| FormatError::Invalid("reach"))?),
    };
    let cost = [reader.number()?, reader.number()?];
    let join = match reader.byte()? {
        LOG => {
            let (mut failed, mut last) = (Vec::new(), 0_u64);
            for _ in 0..reader.count()? {
                last = last.wrapping_add(reader.number()?);
                failed.push(last);
            }
            Join::Log { failed }
        }
        REGIONS => Join::Regions { regions: small(reader)?, state: read_rule_state(reader)? },
        COMPARE => Join::Compare { state: read_rule_state(reader)? },
        _ => return Err(FormatError::Invalid("way to join")),
    };
    Ok(Welcome { client, epoch, sequence, reach, cost, left, join })
}

fn put_rule_state(to: &mut Vec<u8>, state: &RuleState) {
    put_bytes(to, &plain::to_bytes(&state.edit_settings.rules.as_deref()));
    put_bytes(to, &plain::to_bytes(&state.edit_settings.loose));
    put_number(to, state.next_field);
}

fn read_rule_state(reader: &mut Reader) -> Result<Box<RuleState>, FormatError> {
    let rules = read_rules(reader.bytes()?)?;
    let loose = plain::from_bytes(reader.bytes()?, "search for loose pieces")?;
    let edit_settings = EditSettings { rules, loose };
    Ok(Box::new(RuleState { edit_settings, next_field: reader.number()? }))
}
