//! Parses pixels and rays of a command line: `3,4` and `0,0,5 0,0,-1`.

use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::accel::RayFlags;
use anyhit_explain::names;

/// A launch index: `X,Y` or `X,Y,Z`.
///
/// # Errors
/// `InvalidArgument` where it is anything else.
pub fn pixel(text: &str) -> Result<[u32; 3]> {
    index(text, 2, &|why| {
        Error::new(ErrorKind::InvalidArgument, format!("`--pixel {text}` is not X,Y: {why}"))
            .note("for example `--pixel 470,220`; x counts from the left, y from the top")
    })
}

/// A global invocation id: `X`, `X,Y` or `X,Y,Z`.
///
/// # Errors
/// `InvalidArgument` where it is anything else.
pub fn invocation(text: &str) -> Result<[u32; 3]> {
    index(text, 1, &|why| {
        Error::new(ErrorKind::InvalidArgument, format!("`--invocation {text}` is not X,Y,Z: {why}"))
            .note("for example `--invocation 5,0,0`: the shader's GlobalInvocationId")
    })
}

/// From `least` to three whole numbers; those that are missing are 0.
fn index(text: &str, least: usize, invalid: &dyn Fn(String) -> Error) -> Result<[u32; 3]> {
    let parts: Vec<&str> = text.split([',', ' ']).filter(|part| !part.is_empty()).collect();
    if !(least..=3).contains(&parts.len()) {
        return Err(invalid(format!("expected {least} numbers, found {}", parts.len())));
    }
    let mut id = [0; 3];
    for (to, part) in id.iter_mut().zip(parts) {
        *to = part.parse().map_err(|_| invalid(format!("`{part}` is not a non-negative integer")))?;
    }
    Ok(id)
}

/// Origin and direction: six numbers, separated by commas or blanks.
///
/// Returns `None` if the text looks like a name: its first word is no number, and it has no comma.
///
/// # Errors
/// `InvalidArgument` that says which number is wrong or missing.
pub fn ray(text: &str) -> Result<Option<[[f32; 3]; 2]>> {
    const NAMES: [&str; 6] =
        ["origin x", "origin y", "origin z", "direction x", "direction y", "direction z"];
    let parts: Vec<&str> = text.split([',', ' ', '\t']).filter(|part| !part.is_empty()).collect();
    if !text.contains(',') && parts.first().is_some_and(|part| part.parse::<f32>().is_err()) {
        return Ok(None);
    }
    let invalid = |why: String| {
        Error::new(ErrorKind::InvalidArgument, format!("`--ray \"{text}\"`: {why}"))
            .note("a ray is \"ox,oy,oz dx,dy,dz\", for example `--ray \"0,1.5,5 0,-0.2,-1\"`")
    };
    let mut numbers = [0.0f32; 6];
    for (at, part) in parts.iter().enumerate().take(6) {
        let name = NAMES[at];
        numbers[at] = part
            .parse()
            .map_err(|_| invalid(format!("number {} ({name}) is `{part}`, not a number", at + 1)))?;
        if !numbers[at].is_finite() {
            return Err(invalid(format!("number {} ({name}) is {part}: it must be finite", at + 1)));
        }
    }
    if parts.len() < 6 {
        let missing = NAMES[parts.len()];
        return Err(invalid(format!("expected 6 numbers, found {}; {missing} is missing", parts.len())));
    }
    if parts.len() > 6 {
        return Err(invalid(format!("expected 6 numbers, found {}", parts.len())));
    }
    let [ox, oy, oz, dx, dy, dz] = numbers;
    if [dx, dy, dz] == [0.0; 3] {
        return Err(invalid("the direction is zero".into()));
    }
    Ok(Some([[ox, oy, oz], [dx, dy, dz]]))
}

/// Ray flags: names separated by `|`, `,` or blanks, or a number (`12`, `0xc`).
///
/// # Errors
/// `InvalidArgument` for an unknown name.
pub fn flags(text: &str) -> Result<u32> {
    let mut bits = 0;
    for part in text.split([',', '|', ' ']).filter(|part| !part.is_empty()) {
        if part.eq_ignore_ascii_case("none") {
            continue;
        }
        bits |= number(part).or_else(|| names::flag(part)).ok_or_else(|| {
            Error::new(ErrorKind::InvalidArgument, format!("`{part}` is not a ray flag"))
                .note(format!("the flags are {}, or a number", names::all_flags()))
        })?;
    }
    RayFlags(bits).check_known().map_err(|message| {
        Error::new(ErrorKind::InvalidArgument, message)
            .note(format!("the flags are {}, or the sum of their numbers", names::all_flags()))
    })?;
    Ok(bits)
}

/// An unsigned integer of 32 bits, decimal, or hexadecimal or binary with the prefix `0x` or `0b`.
pub fn number(text: &str) -> Option<u32> {
    let text = text.trim();
    if let Some(digits) = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        return u32::from_str_radix(digits, 16).ok();
    }
    if let Some(digits) = text.strip_prefix("0b") {
        return u32::from_str_radix(digits, 2).ok();
    }
    text.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_two_or_three_whole_numbers() {
        assert_eq!(pixel("470,220").unwrap(), [470, 220, 0]);
        assert_eq!(pixel("1, 2, 3").unwrap(), [1, 2, 3]);
        for wrong in ["", "4", "4,", "-1,2", "1.5,2", "1,2,3,4", "a,b", "99999999999,0"] {
            let error = pixel(wrong).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidArgument, "{wrong}");
        }
        assert!(pixel("7,x").unwrap_err().message().contains("`x`"));
    }

    #[test]
    fn an_invocation_is_one_to_three_whole_numbers() {
        assert_eq!(invocation("5").unwrap(), [5, 0, 0]);
        assert_eq!(invocation("5,6,7").unwrap(), [5, 6, 7]);
        let error = invocation("1,x").unwrap_err();
        assert_eq!(error.message(), "`--invocation 1,x` is not X,Y,Z: `x` is not a non-negative integer");
        assert!(invocation("1,2,3,4").is_err() && invocation("").is_err());
    }

    #[test]
    fn a_ray_is_six_numbers() {
        assert_eq!(ray("0,1.5,5 0,-0.25,-1").unwrap(), Some([[0.0, 1.5, 5.0], [0.0, -0.25, -1.0]]));
        assert_eq!(ray("-1 -2 -3 -4 -5 -6e0").unwrap(), Some([[-1.0, -2.0, -3.0], [-4.0, -5.0, -6.0]]));
        assert_eq!(ray("a chain in the field").unwrap(), None);
        assert_eq!(ray("cap 1").unwrap(), None);
        assert!(ray("").unwrap_err().message().contains("expected 6 numbers, found 0; origin x is missing"));
    }

    #[test]
    fn the_wrong_number_of_a_ray_is_named() {
        let message = |text| ray(text).unwrap_err().message().to_owned();
        assert!(message("0,0,5 0,zero,-1").contains("number 5 (direction y) is `zero`"));
        assert!(message("0,0,5 0,0").contains("expected 6 numbers, found 5; direction z is missing"));
        assert!(message("0,0,5 0,0,-1 7").contains("expected 6 numbers, found 7"));
        assert!(message("0,nan,5 0,0,-1").contains("number 2 (origin y) is nan: it must be finite"));
        assert!(message("0,0,1e39 0,0,-1").contains("number 3 (origin z) is 1e39"));
        assert!(message("0,0,5 0,-0,0").contains("the direction is zero"));
    }

    #[test]
    fn flags_are_names_or_numbers() {
        assert_eq!(flags("").unwrap(), 0);
        assert_eq!(flags("none").unwrap(), 0);
        assert_eq!(flags("0xc").unwrap(), 12);
        assert_eq!(flags("TerminateOnFirstHitKHR|skip_closest_hit_shader").unwrap(), 12);
        assert!(flags("0x800").unwrap_err().message().contains("bit 11"));
        assert!(flags("Opaque,Glass").unwrap_err().message().contains("`Glass`"));
    }
}
