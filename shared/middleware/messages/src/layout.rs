//! The description of a layout, made by the same lines that declare the message.

/// A primitive as it lies in memory and in CDR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Unsigned 8 bit.
    U8,
    /// Signed 8 bit.
    I8,
    /// Unsigned 16 bit.
    U16,
    /// Unsigned 32 bit.
    U32,
    /// Unsigned 64 bit.
    U64,
    /// Signed 64 bit.
    I64,
    /// IEEE double.
    F64,
    /// Another layout.
    Nested(&'static Layout),
}

/// What the numbers of a field stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning {
    /// Themselves.
    Number,
    /// Each for a variant of this enumeration.
    Code(&'static Enumeration),
    /// All of them for a text: UTF-8, filled up with zeros.
    Text,
}

/// An enumeration that messages carry as its number.
#[derive(Debug, PartialEq, Eq)]
pub struct Enumeration {
    /// Name: `Mode`.
    pub name: &'static str,
    /// What it tells apart.
    pub doc: &'static str,
    /// Its variants.
    pub variants: &'static [Variant],
}

impl Enumeration {
    /// The words for `code`; none for a number that stands for nothing.
    #[must_use]
    pub fn words(&self, code: u8) -> Option<&'static str> {
        self.variants.iter().find(|variant| variant.code == code).map(|variant| variant.words)
    }
}

/// A variant of an enumeration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// Name: `NoPlan`.
    pub name: &'static str,
    /// The number that messages carry.
    pub code: u8,
    /// The words used for it everywhere.
    pub words: &'static str,
}

/// A type that says what the numbers of a field stand for.
pub trait Meaningful {
    /// What they stand for.
    const MEANING: Meaning;
}

/// The meaning of bytes that are a text: see [`crate::text`].
#[derive(Clone, Copy, Debug)]
pub struct Text;

impl Meaningful for Text {
    const MEANING: Meaning = Meaning::Text;
}

/// A field of a layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name.
    pub name: &'static str,
    /// What one element is.
    pub kind: Kind,
    /// How many elements; none for a single value.
    pub count: Option<usize>,
    /// What its numbers stand for.
    pub meaning: Meaning,
    /// Bytes from the layout's beginning.
    pub offset: usize,
    /// What it means, with unit.
    pub doc: &'static str,
}

impl Field {
    /// Whether it holds text: UTF-8, filled up with zeros.
    #[must_use]
    pub const fn is_text(&self) -> bool {
        matches!(self.meaning, Meaning::Text)
    }

    /// Whether nothing is in it: it fills a gap that the compiler would leave.
    #[must_use]
    pub fn is_reserved(&self) -> bool {
        self.name == "reserved"
    }
}

impl Kind {
    /// Bytes of one element.
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 => 2,
            Self::U32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
            Self::Nested(layout) => layout.size,
        }
    }
}

/// A message or a part of one.
#[derive(Debug, PartialEq, Eq)]
pub struct Layout {
    /// Name, as in schemas: `Raw`.
    pub name: &'static str,
    /// Size in bytes.
    pub size: usize,
    /// Alignment in bytes.
    pub alignment: usize,
    /// What it is.
    pub doc: &'static str,
    /// Its fields in order, without gaps.
    pub fields: &'static [Field],
}

/// A type that may be a field.
pub trait Element {
    /// What one element is.
    const KIND: Kind;
    /// How many; none for a single value.
    const COUNT: Option<usize> = None;
}

macro_rules! primitive {
    ($($type:ty => $kind:ident),* $(,)?) => {
        $(impl Element for $type { const KIND: Kind = Kind::$kind; })*
    };
}

primitive! { u8 => U8, i8 => I8, u16 => U16, u32 => U32, u64 => U64, i64 => I64, f64 => F64 }

impl<T: Element, const N: usize> Element for [T; N] {
    const KIND: Kind = T::KIND;
    // Arrays of arrays lie flat in memory and in CDR.
    const COUNT: Option<usize> = match T::COUNT {
        Some(inner) => Some(N * inner),
        None => Some(N),
    };
}

/// A type that describes itself.
pub trait Described {
    /// Its description.
    const LAYOUT: &'static Layout;
}

/// Declares a plain struct together with its description; a padding byte is a compile error. A field whose numbers
/// stand for something says so: `pub mode: u8 as Mode`, `pub text: [u8; 64] as Text`.
macro_rules! layout {
    (@meaning) => { $crate::layout::Meaning::Number };
    (@meaning $meaning:ty) => { <$meaning as $crate::layout::Meaningful>::MEANING };
    ($(#[doc = $doc:literal])+ pub struct $name:ident {
        $($(#[doc = $field_doc:literal])+ pub $field:ident: $type:ty $(as $meaning:ty)?,)+
    }) => {
        $(#[doc = $doc])+
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        pub struct $name {
            $($(#[doc = $field_doc])+ pub $field: $type,)+
        }

        impl $crate::layout::Described for $name {
            const LAYOUT: &'static $crate::layout::Layout = &$crate::layout::Layout {
                name: stringify!($name),
                size: core::mem::size_of::<$name>(),
                alignment: core::mem::align_of::<$name>(),
                doc: concat!($($doc),+),
                fields: &[$($crate::layout::Field {
                    name: stringify!($field),
                    kind: <$type as $crate::layout::Element>::KIND,
                    count: <$type as $crate::layout::Element>::COUNT,
                    meaning: $crate::layout::layout!(@meaning $($meaning)?),
                    offset: core::mem::offset_of!($name, $field),
                    doc: concat!($($field_doc),+),
                }),+],
            };
        }

        impl $crate::layout::Element for $name {
            const KIND: $crate::layout::Kind =
                $crate::layout::Kind::Nested(<$name as $crate::layout::Described>::LAYOUT);
        }

        impl Default for $name {
            fn default() -> Self {
                bytemuck::Zeroable::zeroed()
            }
        }
    };
}

pub(crate) use layout;
