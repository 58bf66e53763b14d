//! Inks, lines and areas: names of classes that the style sheet gives a look.

/// Colours that stay apart for colour-blind eyes (Okabe and Ito, "Color Universal Design", 2008),
/// tuned per theme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// Blue.
    Blue,
    /// Orange.
    Orange,
    /// Bluish green.
    Green,
    /// Vermilion.
    Vermilion,
    /// Reddish purple.
    Purple,
    /// Sky blue.
    Sky,
    /// Grey, for what is beside the point.
    Grey,
    /// The colour of the text.
    Text,
}

impl Ink {
    /// Inks for things without a meaning of their own, in order; the ninth is the first again.
    #[must_use]
    pub fn nth(index: usize) -> Self {
        const ORDER: [Ink; 6] =
            [Ink::Blue, Ink::Orange, Ink::Green, Ink::Purple, Ink::Vermilion, Ink::Sky];
        ORDER[index % ORDER.len()]
    }

    pub(crate) const fn class(self) -> &'static str {
        match self {
            Self::Blue => "blue",
            Self::Orange => "orange",
            Self::Green => "green",
            Self::Vermilion => "vermilion",
            Self::Purple => "purple",
            Self::Sky => "sky",
            Self::Grey => "grey",
            Self::Text => "ink",
        }
    }
}

/// How a thing is judged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    /// Not judged.
    #[default]
    Plain,
    /// As it should be.
    Good,
    /// Worth a look.
    Warn,
    /// Not as it should be.
    Bad,
}

impl Tone {
    /// [`Tone::Good`] or [`Tone::Bad`].
    #[must_use]
    pub const fn of(good: bool) -> Self {
        if good { Self::Good } else { Self::Bad }
    }

    /// The class in the style sheet.
    #[must_use]
    pub const fn class(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Good => "good",
            Self::Warn => "warn",
            Self::Bad => "bad",
        }
    }
}

/// How a line is broken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dash {
    /// Not at all.
    #[default]
    Solid,
    /// Dashes.
    Dashed,
    /// Dots.
    Dotted,
}

/// How wide a line is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Weight {
    /// For detail.
    Thin,
    /// For most.
    #[default]
    Normal,
    /// Wide and pale: lies below another line and shows on both of its sides.
    Wide,
}

/// The look of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line {
    /// Colour.
    pub ink: Ink,
    /// Breaks.
    pub dash: Dash,
    /// Width.
    pub weight: Weight,
}

impl Line {
    /// A solid line of normal width.
    #[must_use]
    pub const fn new(ink: Ink) -> Self {
        Self { ink, dash: Dash::Solid, weight: Weight::Normal }
    }

    /// The same line, dashed.
    #[must_use]
    pub const fn dashed(self) -> Self {
        Self { dash: Dash::Dashed, ..self }
    }

    /// The same line, dotted.
    #[must_use]
    pub const fn dotted(self) -> Self {
        Self { dash: Dash::Dotted, ..self }
    }

    /// The same line, thin.
    #[must_use]
    pub const fn thin(self) -> Self {
        Self { weight: Weight::Thin, ..self }
    }

    /// The same line, wide and pale.
    #[must_use]
    pub const fn wide(self) -> Self {
        Self { weight: Weight::Wide, ..self }
    }

    pub(crate) fn class(self) -> String {
        let dash = match self.dash {
            Dash::Solid => "",
            Dash::Dashed => " dashed",
            Dash::Dotted => " dotted",
        };
        let weight = match self.weight {
            Weight::Thin => " thin",
            Weight::Normal => "",
            Weight::Wide => " wide",
        };
        format!("line {}{dash}{weight}", self.ink.class())
    }
}

/// The look of an area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Area {
    /// Ground that may be driven on.
    Free,
    /// What must not be touched.
    Obstacle,
    /// A marked place, such as a slot.
    Place,
    /// An outline and a breath of colour: one of many in a row.
    Trail(Ink),
    /// An outline, broken, without a fill.
    Outline(Ink),
    /// An outline with a fill.
    Solid(Ink),
}

impl Area {
    pub(crate) fn class(self) -> String {
        match self {
            Self::Free => "free".to_owned(),
            Self::Obstacle => "obstacle".to_owned(),
            Self::Place => "place".to_owned(),
            Self::Trail(ink) => format!("trail {}", ink.class()),
            Self::Outline(ink) => format!("outline {}", ink.class()),
            Self::Solid(ink) => format!("solid {}", ink.class()),
        }
    }
}
