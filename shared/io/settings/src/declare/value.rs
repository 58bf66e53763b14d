//! Values of keys, and how they enter and leave typed fields.

use core::fmt;
use core::time::Duration;
use std::collections::BTreeMap;

/// A value as a file states it, already of the declared type.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A finite number; an integer in the file counts as one.
    Number(f64),
    /// A whole number.
    Integer(i64),
    /// `true` or `false`.
    Flag(bool),
    /// Text, or the name of a choice.
    Text(String),
    /// A list.
    List(Vec<Value>),
    /// A table of free keys.
    Table(BTreeMap<String, Value>),
}

impl fmt::Display for Value {
    /// As TOML writes it, on one line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // `{:?}` keeps point or exponent, so that the number stays one when read again.
            Self::Number(number) => write!(f, "{number:?}"),
            Self::Integer(number) => write!(f, "{number}"),
            Self::Flag(flag) => write!(f, "{flag}"),
            Self::Text(text) => write_text(f, text),
            Self::List(values) => {
                f.write_str("[")?;
                write_joined(f, values, |f, value| write!(f, "{value}"))?;
                f.write_str("]")
            }
            Self::Table(entries) => {
                f.write_str("{ ")?;
                write_joined(f, entries, |f, (key, value)| {
                    write_text(f, key)?;
                    write!(f, " = {value}")
                })?;
                f.write_str(" }")
            }
        }
    }
}

fn write_joined<I: IntoIterator>(
    f: &mut fmt::Formatter<'_>,
    items: I,
    write: impl Fn(&mut fmt::Formatter<'_>, I::Item) -> fmt::Result,
) -> fmt::Result {
    for (index, item) in items.into_iter().enumerate() {
        if index > 0 {
            f.write_str(", ")?;
        }
        write(f, item)?;
    }
    Ok(())
}

fn write_text(f: &mut fmt::Formatter<'_>, text: &str) -> fmt::Result {
    f.write_str("\"")?;
    for character in text.chars() {
        match character {
            '"' | '\\' => write!(f, "\\{character}")?,
            control if control.is_control() => write!(f, "\\U{:08X}", u32::from(control))?,
            other => write!(f, "{other}")?,
        }
    }
    f.write_str("\"")
}

/// A typed field that a key fills.
pub(crate) trait Field: Sized {
    /// The field of that value; none where the type cannot hold it.
    fn take(value: &Value) -> Option<Self>;

    /// The value of the field; none where it holds nothing.
    fn show(&self) -> Option<Value>;
}

impl Field for f64 {
    fn take(value: &Value) -> Option<Self> {
        match value {
            Value::Number(number) => Some(*number),
            _ => None,
        }
    }

    /// A number that is not finite stands for "not stated".
    fn show(&self) -> Option<Value> {
        self.is_finite().then_some(Value::Number(*self))
    }
}

/// Seconds.
impl Field for Duration {
    fn take(value: &Value) -> Option<Self> {
        Self::try_from_secs_f64(f64::take(value)?).ok()
    }

    fn show(&self) -> Option<Value> {
        self.as_secs_f64().show()
    }
}

macro_rules! integers {
    ($($type:ty),*) => {$(
        impl Field for $type {
            fn take(value: &Value) -> Option<Self> {
                match value {
                    Value::Integer(number) => Self::try_from(*number).ok(),
                    _ => None,
                }
            }

            fn show(&self) -> Option<Value> {
                i64::try_from(*self).ok().map(Value::Integer)
            }
        }
    )*};
}

integers!(u8, u32, u64, usize);

impl Field for bool {
    fn take(value: &Value) -> Option<Self> {
        match value {
            Value::Flag(flag) => Some(*flag),
            _ => None,
        }
    }

    fn show(&self) -> Option<Value> {
        Some(Value::Flag(*self))
    }
}

impl Field for String {
    fn take(value: &Value) -> Option<Self> {
        match value {
            Value::Text(text) => Some(text.clone()),
            _ => None,
        }
    }

    fn show(&self) -> Option<Value> {
        (!self.is_empty()).then(|| Value::Text(self.clone()))
    }
}

impl<F: Field> Field for Option<F> {
    fn take(value: &Value) -> Option<Self> {
        F::take(value).map(Some)
    }

    fn show(&self) -> Option<Value> {
        self.as_ref().and_then(Field::show)
    }
}

impl<F: Field> Field for Vec<F> {
    fn take(value: &Value) -> Option<Self> {
        match value {
            Value::List(values) => values.iter().map(F::take).collect(),
            _ => None,
        }
    }

    fn show(&self) -> Option<Value> {
        let values: Option<Vec<_>> = self.iter().map(Field::show).collect();
        values.filter(|values| !values.is_empty()).map(Value::List)
    }
}

impl<F: Field, const N: usize> Field for [F; N] {
    fn take(value: &Value) -> Option<Self> {
        Vec::take(value)?.try_into().ok()
    }

    fn show(&self) -> Option<Value> {
        self.iter().map(Field::show).collect::<Option<Vec<_>>>().map(Value::List)
    }
}

impl Field for BTreeMap<String, Value> {
    fn take(value: &Value) -> Option<Self> {
        match value {
            Value::Table(entries) => Some(entries.clone()),
            _ => None,
        }
    }

    fn show(&self) -> Option<Value> {
        (!self.is_empty()).then(|| Value::Table(self.clone()))
    }
}

/// Declares an enum whose variants files name, with what each means.
macro_rules! choices {
    ($(#[doc = $doc:literal])+ pub enum $name:ident {
        $($(#[doc = $variant_doc:literal])+ $variant:ident = $text:literal,)+
    }) => {
        $(#[doc = $doc])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name {
            $($(#[doc = $variant_doc])+ $variant,)+
        }

        impl $name {
            /// The names that files use.
            pub const NAMES: &'static [&'static str] = &[$($text),+];

            /// The name that files use.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }
        }

        impl crate::declare::Field for $name {
            fn take(value: &crate::declare::Value) -> Option<Self> {
                match value {
                    crate::declare::Value::Text(text) => match text.as_str() {
                        $($text => Some(Self::$variant),)+
                        _ => None,
                    },
                    _ => None,
                }
            }

            fn show(&self) -> Option<crate::declare::Value> {
                Some(crate::declare::Value::Text(self.name().to_owned()))
            }
        }
    };
}

pub(crate) use choices;
