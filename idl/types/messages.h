#pragma once

#include "idl/types/messages/commands.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/external.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/journal.h"
#include "idl/types/messages/log.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/role.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/session.h"
#include "idl/types/messages/steps.h"
#include "idl/types/messages/timing.h"

/// The messages of the protocol as C++ types; `idl/tenon.idl` is their form on the network.
/// `idl/wire/fields.h` maps between the two without loss of a bit. SI units; frames as in the glossary.
/// Streams have a fixed size and may be filled in a 1 kHz loop; states and events contain strings, which
/// allocate.
///
/// All of them, for code that serves every message. Others include the group they use, so that a change of
/// one group compiles only its users again.
