//! Where changes are in a file, and the file with all of them behind their numbers.
//!
//! An expression becomes `(if off(7, 2) { it, with the places inside it } else if on(7) { changed } else { changed })`: what is changed holds no
//! further places, so that the file grows little, and what was there comes first, so that its types are those of the whole.

use crate::Change;
use std::{collections::HashMap, ops::Range};
use syn::{BinOp, Expr, spanned::Spanned, visit::Visit};

/// Outer kinds first, where two have one range.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    /// An arm of a `match` that serves nothing: its guard, or where one would be.
    Arm,
    /// All of a function, which returns something else.
    Body,
    /// One expression in place of another.
    Expression,
}

pub struct Place {
    range: Range<usize>,
    kind: Kind,
    /// Which of the list, and what it puts there.
    changes: Vec<(usize, String)>,
}

impl Place {
    /// Without changes that do not compile; whether others are left.
    pub fn keep(&mut self, keeps: impl Fn(usize) -> bool) -> bool {
        self.changes.retain(|(change, _)| keeps(*change));
        !self.changes.is_empty()
    }
}

/// What a file holds that can be changed, by where cargo-mutants says that it is.
#[derive(Default)]
struct Found {
    lines: Vec<usize>,
    /// By operators, which have one expression each.
    expressions: HashMap<usize, Range<usize>>,
    /// Guards of arms, or where they would be.
    arms: HashMap<usize, Range<usize>>,
    /// Of structures: the field with its comma, and the expression.
    fields: HashMap<usize, (Range<usize>, Range<usize>)>,
}

impl Found {
    fn range(&self, text: &str, node: &impl Spanned) -> Range<usize> {
        let at = |place: proc_macro2::LineColumn| self.at(text, place.line, place.column);
        at(node.span().start())..at(node.span().end())
    }

    /// Of a line, counted from 1, and a column in characters, counted from 0.
    fn at(&self, text: &str, line: usize, column: usize) -> usize {
        let start = self.lines[line - 1];
        text[start..].char_indices().nth(column).map_or(text.len(), |(offset, _)| start + offset)
    }
}

struct Finder<'a>(&'a str, Found);

impl Finder<'_> {
    fn range(&self, node: &impl Spanned) -> Range<usize> {
        self.1.range(self.0, node)
    }
}

impl<'ast> Visit<'ast> for Finder<'_> {
    fn visit_expr_binary(&mut self, node: &'ast syn::ExprBinary) {
        // A chain of `let` stands in no parentheses.
        if !holds_let(&Expr::Binary(node.clone())) {
            let (operator, whole) = (self.range(&node.op), self.range(node));
            self.1.expressions.insert(operator.start, whole);
        }
        syn::visit::visit_expr_binary(self, node);
    }

    fn visit_expr_unary(&mut self, node: &'ast syn::ExprUnary) {
        let (operator, whole) = (self.range(&node.op), self.range(node));
        self.1.expressions.insert(operator.start, whole);
        syn::visit::visit_expr_unary(self, node);
    }

    fn visit_arm(&mut self, node: &'ast syn::Arm) {
        let arrow = self.range(&node.fat_arrow_token).start;
        let guard = node.guard.as_ref().map_or(arrow..arrow, |(_, guard)| self.range(guard));
        let start = self.range(node).start;
        self.1.arms.insert(start, guard);
        syn::visit::visit_arm(self, node);
    }

    fn visit_expr_struct(&mut self, node: &'ast syn::ExprStruct) {
        let whole = self.range(node);
        for pair in node.fields.pairs() {
            let field = self.range(pair.value());
            let end = pair.punct().map_or(field.end, |comma| self.range(comma).end);
            self.1.fields.insert(field.start, (field.start..end, whole.clone()));
        }
        syn::visit::visit_expr_struct(self, node);
    }
}

fn holds_let(expression: &Expr) -> bool {
    match expression {
        Expr::Let(_) => true,
        Expr::Binary(node) if matches!(node.op, BinOp::And(_) | BinOp::Or(_)) => holds_let(&node.left) || holds_let(&node.right),
        _ => false,
    }
}

/// The places of a file, outer ones before those inside them, and changes that have none.
pub fn places(text: &str, changes: &[(usize, &Change)]) -> (Vec<Place>, Vec<usize>) {
    let lines = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
    let mut finder = Finder(text, Found { lines, ..Found::default() });
    finder.visit_file(&syn::parse_file(text).expect("a source that compiles"));
    let Finder(_, found) = finder;
    let (mut places, mut without) = (Vec::<Place>::new(), Vec::new());
    for &(id, change) in changes {
        let Some((kind, range, new)) = place(text, &found, change) else {
            without.push(id);
            continue;
        };
        match places.iter_mut().find(|place| place.kind == kind && place.range == range) {
            Some(place) => place.changes.push((id, new)),
            None => places.push(Place { range, kind, changes: vec![(id, new)] }),
        }
    }
    places.sort_by_key(|place| (place.range.start, std::cmp::Reverse(place.range.end), place.kind));
    (places, without)
}

fn place(text: &str, found: &Found, change: &Change) -> Option<(Kind, Range<usize>, String)> {
    let at = |place: &crate::Point| found.at(text, place.line, place.column - 1);
    let span = at(&change.span.start)..at(&change.span.end);
    let new = &change.replacement;
    let instead = |part: Range<usize>, whole: Range<usize>| format!("{}{new}{}", &text[whole.start..part.start], &text[part.end..whole.end]);
    Some(match change.genre.as_str() {
        "BinaryOperator" | "UnaryOperator" => {
            let whole = found.expressions.get(&span.start)?.clone();
            (Kind::Expression, whole.clone(), instead(span, whole))
        }
        "MatchArmGuard" => (Kind::Expression, span, new.clone()),
        "StructField" => {
            let (field, whole) = found.fields.get(&span.start)?.clone();
            (Kind::Expression, whole.clone(), instead(field, whole))
        }
        "MatchArm" => (Kind::Arm, found.arms.get(&span.start)?.clone(), String::new()),
        "FnValue" => (Kind::Body, span, new.clone()),
        _ => return None,
    })
}

/// A file with its changes, and where each of them and each place is in it.
pub struct Written<'a> {
    pub text: String,
    pub changes: Vec<(Range<usize>, usize)>,
    pub places: Vec<(Range<usize>, Vec<usize>)>,
    /// The change of each number and the first number of its place, of all files. Numbers of one place follow each other.
    numbers: &'a mut Vec<(usize, usize)>,
}

impl<'a> Written<'a> {
    pub fn new(text: &str, places: &[Place], numbers: &'a mut Vec<(usize, usize)>) -> Self {
        let mut written = Self { text: String::new(), changes: Vec::new(), places: Vec::new(), numbers };
        written.part(text, 0..text.len(), places);
        written
    }

    /// Places are those that begin within the range, in order.
    fn part(&mut self, text: &str, range: Range<usize>, mut places: &[Place]) {
        let mut at = range.start;
        while let Some((place, rest)) = places.split_first() {
            let inside = rest.iter().take_while(|other| other.range.start < place.range.end).count();
            self.text.push_str(&text[at..place.range.start]);
            self.place(text, place, &rest[..inside]);
            at = place.range.end;
            places = &rest[inside..];
        }
        self.text.push_str(&text[at..range.end]);
    }

    fn place(&mut self, text: &str, place: &Place, inside: &[Place]) {
        let start = self.text.len();
        let first = self.numbers.len();
        self.numbers.extend(place.changes.iter().map(|(change, _)| (*change, first)));
        let off = format!("crate::mutant::off({first}, {})", place.changes.len());
        match place.kind {
            Kind::Arm if place.range.is_empty() => self.text.push_str(&format!("if {off} ")),
            Kind::Arm => {
                self.text.push_str(&format!("{off} && ("));
                self.part(text, place.range.clone(), inside);
                self.text.push(')');
            }
            Kind::Body => {
                self.text.push_str(&format!("if !{off} {{ "));
                self.each(place, first, |new| format!("return {new};"));
                self.text.push_str(" }\n");
                self.part(text, place.range.clone(), inside);
            }
            Kind::Expression => {
                self.text.push_str(&format!("(if {off} {{ "));
                self.part(text, place.range.clone(), inside);
                self.text.push_str(" } else ");
                self.each(place, first, str::to_owned);
                self.text.push(')');
            }
        }
        self.places.push((start..self.text.len(), place.changes.iter().map(|(change, _)| *change).collect()));
    }

    /// `if on(7) { one } else { the other }`
    fn each(&mut self, place: &Place, first: usize, put: impl Fn(&str) -> String) {
        for (index, (change, new)) in place.changes.iter().enumerate() {
            let is_last = index + 1 == place.changes.len();
            self.text.push_str(&if is_last { "{ ".to_owned() } else { format!("if crate::mutant::on({}) {{ ", first + index) });
            let start = self.text.len();
            self.text.push_str(&put(new));
            self.changes.push((start..self.text.len(), *change));
            self.text.push_str(if is_last { " }" } else { " } else " });
        }
    }
}
