//! The formula by which a vertex shader computes its position, as text.
//!
//! Calls are replaced by what they return, variables by what they hold, so that equal text means equal operations in
//! the same order on the same inputs. Code with branches is left out; a value that depends on it reads `branch`.

use std::collections::HashMap;

use naga::{
    Binding, Block, BuiltIn, Expression, Function, Handle, LocalVariable, Module, ShaderStage, Statement,
    TypeInner,
};

/// A shader's position.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Position {
    /// Whether it is declared `@invariant`.
    pub is_invariant: bool,
    pub formula: String,
}

impl Position {
    /// That of a module's vertex shader.
    pub fn of(module: &Module) -> Self {
        let mut entries = module.entry_points.iter().filter(|entry| entry.stage == ShaderStage::Vertex);
        let entry = entries.next().expect("a vertex shader");
        let result = entry.function.result.as_ref().expect("a vertex shader returns something");
        let TypeInner::Struct { members, .. } = &module.types[result.ty].inner else {
            panic!("a vertex shader returns a struct")
        };
        let place = members.iter().enumerate().find_map(|(at, member)| match member.binding {
            Some(Binding::BuiltIn(BuiltIn::Position { invariant })) => Some((at, invariant)),
            _ => None,
        });
        let (member, is_invariant) = place.expect("a vertex shader returns a position");
        let arguments =
            entry.function.arguments.iter().map(|argument| match &module.types[argument.ty].inner {
                TypeInner::Struct { members, .. } => {
                    Value::Parts(members.iter().map(|member| input(member.binding.as_ref())).collect())
                }
                _ => input(argument.binding.as_ref()),
            });
        let returned = Frame::run(module, &entry.function, arguments.collect());
        Self { is_invariant, formula: returned.part(member as u32).text() }
    }
}

/// An input of the vertex shader. Positions are at location 0 in every pass, others may be elsewhere.
fn input(binding: Option<&Binding>) -> Value {
    Value::Text(match binding {
        Some(Binding::BuiltIn(built_in)) => format!("{built_in:?}"),
        Some(Binding::Location { location, .. }) => format!("location {location}"),
        None => "unbound".into(),
    })
}

#[derive(Clone)]
enum Value {
    Text(String),
    Parts(Vec<Value>),
    /// A variable of the function, and members of members of it.
    Place(Handle<LocalVariable>, Vec<u32>),
}

impl Value {
    fn part(&self, index: u32) -> Self {
        match self {
            Self::Parts(parts) => parts[index as usize].clone(),
            Self::Text(text) => Self::Text(format!("{text}.{index}")),
            Self::Place(variable, path) => Self::Place(*variable, [path.as_slice(), &[index]].concat()),
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Parts(parts) => list(parts),
            Self::Place(..) => "pointer".into(),
        }
    }
}

fn list(values: &[Value]) -> String {
    format!("({})", values.iter().map(Value::text).collect::<Vec<_>>().join(", "))
}

/// A call of a function.
struct Frame<'a> {
    module: &'a Module,
    function: &'a Function,
    arguments: Vec<Value>,
    values: HashMap<Handle<Expression>, Value>,
    variables: HashMap<Handle<LocalVariable>, Value>,
    returned: Option<Value>,
}

impl<'a> Frame<'a> {
    /// What the function returns.
    fn run(module: &'a Module, function: &'a Function, arguments: Vec<Value>) -> Value {
        let (values, variables) = (HashMap::new(), HashMap::new());
        let mut frame = Self { module, function, arguments, values, variables, returned: None };
        frame.block(&function.body);
        frame.returned.unwrap_or_else(|| Value::Text("branch".into()))
    }

    fn block(&mut self, block: &Block) {
        for statement in block {
            match statement {
                Statement::Emit(range) => range.clone().for_each(|expression| {
                    let value = self.evaluate(expression);
                    self.values.insert(expression, value);
                }),
                Statement::Block(block) => self.block(block),
                Statement::Store { pointer, value } => {
                    let value = self.value(*value);
                    if let Value::Place(variable, path) = self.value(*pointer) {
                        let parts = self.count_parts(variable);
                        let held =
                            self.variables.entry(variable).or_insert_with(|| Value::Text("zero".into()));
                        store(held, &path, parts, value);
                    }
                }
                Statement::Call { function, arguments, result } => {
                    let arguments = arguments.iter().map(|argument| self.value(*argument)).collect();
                    let value = Self::run(self.module, &self.module.functions[*function], arguments);
                    if let Some(result) = result {
                        self.values.insert(*result, value);
                    }
                }
                Statement::Return { value } => {
                    let value = value.map(|value| self.value(value));
                    self.returned = self.returned.take().or(value);
                }
                Statement::If { accept, reject, .. } => {
                    self.forget(accept);
                    self.forget(reject);
                }
                Statement::Switch { cases, .. } => cases.iter().for_each(|case| self.forget(&case.body)),
                Statement::Loop { body, continuing, .. } => {
                    self.forget(body);
                    self.forget(continuing);
                }
                _ => {}
            }
        }
    }

    /// Variables that a branch stores to, and what it may return, are unknown after it.
    fn forget(&mut self, block: &Block) {
        for statement in block {
            match statement {
                Statement::Return { .. } => self.returned = Some(Value::Text("branch".into())),
                Statement::Store { pointer, .. } => {
                    if let Some(variable) = self.root(*pointer) {
                        self.variables.insert(variable, Value::Text("branch".into()));
                    }
                }
                Statement::Call { arguments, .. } => {
                    let stored: Vec<_> =
                        arguments.iter().filter_map(|argument| self.root(*argument)).collect();
                    let unknown = stored.into_iter().map(|variable| (variable, Value::Text("branch".into())));
                    self.variables.extend(unknown);
                }
                Statement::Block(block) => self.forget(block),
                Statement::If { accept, reject, .. } => {
                    self.forget(accept);
                    self.forget(reject);
                }
                Statement::Switch { cases, .. } => cases.iter().for_each(|case| self.forget(&case.body)),
                Statement::Loop { body, continuing, .. } => {
                    self.forget(body);
                    self.forget(continuing);
                }
                _ => {}
            }
        }
    }

    /// The variable that a pointer leads to.
    fn root(&self, pointer: Handle<Expression>) -> Option<Handle<LocalVariable>> {
        match self.function.expressions[pointer] {
            Expression::LocalVariable(variable) => Some(variable),
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => self.root(base),
            _ => None,
        }
    }

    fn value(&self, expression: Handle<Expression>) -> Value {
        self.values.get(&expression).cloned().unwrap_or_else(|| self.evaluate(expression))
    }

    fn evaluate(&self, expression: Handle<Expression>) -> Value {
        let text = |at: &Handle<Expression>| self.value(*at).text();
        let some = |at: &Option<Handle<Expression>>| at.map(|at| self.value(at).text()).unwrap_or_default();
        match &self.function.expressions[expression] {
            Expression::Compose { components, .. } => {
                Value::Parts(components.iter().map(|component| self.value(*component)).collect())
            }
            Expression::AccessIndex { base, index } => self.value(*base).part(*index),
            Expression::FunctionArgument(index) => self.arguments[*index as usize].clone(),
            Expression::LocalVariable(variable) => Value::Place(*variable, vec![]),
            Expression::Load { pointer } => match self.value(*pointer) {
                Value::Place(variable, path) => {
                    let held = self.variables.get(&variable).cloned();
                    let held = held.unwrap_or_else(|| self.initial(variable));
                    path.iter().fold(held, |value, index| value.part(*index))
                }
                global => global,
            },
            Expression::GlobalVariable(global) => {
                Value::Text(self.module.global_variables[*global].name.clone().unwrap_or_default())
            }
            other => Value::Text(match other {
                Expression::Literal(literal) => format!("{literal:?}"),
                Expression::Constant(constant) => format!("{:?}", self.module.constants[*constant].name),
                Expression::ZeroValue(_) => "zero".into(),
                Expression::Access { base, index } => format!("{}[{}]", text(base), text(index)),
                Expression::Splat { size, value } => format!("splat {size:?} {}", text(value)),
                Expression::Swizzle { size, vector, pattern } => {
                    format!("{}.{:?}", text(vector), &pattern[..*size as usize])
                }
                Expression::Unary { op, expr } => format!("{op:?}({})", text(expr)),
                Expression::Binary { op, left, right } => format!("{op:?}({}, {})", text(left), text(right)),
                Expression::Select { condition, accept, reject } => {
                    format!("select({}, {}, {})", text(condition), text(accept), text(reject))
                }
                Expression::Math { fun, arg, arg1, arg2, arg3 } => {
                    format!("{fun:?}({}, {}, {}, {})", text(arg), some(arg1), some(arg2), some(arg3))
                }
                Expression::As { expr, kind, convert } => format!("{kind:?} {convert:?} {}", text(expr)),
                _ => "other".into(),
            }),
        }
    }

    fn initial(&self, variable: Handle<LocalVariable>) -> Value {
        let initial = self.function.local_variables[variable].init;
        initial.map_or(Value::Text("zero".into()), |initial| self.value(initial))
    }

    fn count_parts(&self, variable: Handle<LocalVariable>) -> usize {
        match &self.module.types[self.function.local_variables[variable].ty].inner {
            TypeInner::Struct { members, .. } => members.len(),
            _ => 4,
        }
    }
}

/// Stores into a part of a value, which is taken apart for it.
fn store(held: &mut Value, path: &[u32], parts: usize, value: Value) {
    let Some((first, rest)) = path.split_first() else {
        *held = value;
        return;
    };
    if !matches!(held, Value::Parts(_)) {
        *held = Value::Parts((0..parts.max(4) as u32).map(|index| held.part(index)).collect());
    }
    if let Value::Parts(parts) = held {
        store(&mut parts[*first as usize], rest, 4, value);
    }
}
