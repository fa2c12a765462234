//! The text encodings of slmsuite's protocol: percent-encoding of a form (`quote_plus`) and base64.

/// Undoes `quote_plus`: `+` is a space, `%41` is `A`. None where a `%` is not followed by two hexadecimal digits.
pub(super) fn unquote_plus(text: &[u8]) -> Option<Vec<u8>> {
    let mut plain = Vec::with_capacity(text.len());
    let mut rest = text.iter();
    while let Some(&byte) = rest.next() {
        plain.push(match byte {
            b'+' => b' ',
            b'%' => 16 * hexadecimal(*rest.next()?)? + hexadecimal(*rest.next()?)?,
            other => other,
        });
    }
    Some(plain)
}

/// Percent-encodes all but letters, digits and `_.-~`; a space becomes `+`.
pub(super) fn quote_plus(plain: &[u8]) -> String {
    let mut text = String::with_capacity(plain.len() * 3 / 2);
    for &byte in plain {
        match byte {
            b' ' => text.push('+'),
            b'_' | b'.' | b'-' | b'~' => text.push(char::from(byte)),
            _ if byte.is_ascii_alphanumeric() => text.push(char::from(byte)),
            _ => text.extend(['%', digit(byte >> 4), digit(byte & 15)]),
        }
    }
    text
}

/// Undoes base64 (RFC 4648, section 4, with padding). None for anything else.
pub(super) fn base64(text: &[u8]) -> Option<Vec<u8>> {
    if !text.len().is_multiple_of(4) {
        return None;
    }
    let padding = text.iter().rev().take_while(|&&byte| byte == b'=').count();
    if padding > 2 {
        return None;
    }
    let (mut plain, mut gathered, mut bits) = (Vec::with_capacity(text.len() / 4 * 3), 0u32, 0);
    for &byte in &text[..text.len() - padding] {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        gathered = gathered << 6 | u32::from(value);
        bits += 6;
        if bits >= 8 {
            bits -= 8;
            plain.push((gathered >> bits) as u8);
            gathered &= (1 << bits) - 1;
        }
    }
    Some(plain)
}

fn hexadecimal(digit: u8) -> Option<u8> {
    char::from(digit).to_digit(16).map(|value| value as u8)
}

fn digit(value: u8) -> char {
    char::from(b"0123456789ABCDEF"[usize::from(value)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn known_texts() {
        // Python: urllib.parse.quote_plus('{"a": [1, "é/~"]}').
        let (plain, quoted) = ("{\"a\": [1, \"é/~\"]}", "%7B%22a%22%3A+%5B1%2C+%22%C3%A9%2F~%22%5D%7D");
        assert_eq!(quote_plus(plain.as_bytes()), quoted);
        assert_eq!(unquote_plus(quoted.as_bytes()).as_deref(), Some(plain.as_bytes()));
        assert_eq!(unquote_plus(b"%7b").as_deref(), Some(&b"{"[..]));
        // RFC 4648, section 10.
        for (plain, text) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg==")] {
            assert_eq!(base64(text.as_bytes()).as_deref(), Some(plain.as_bytes()), "{text}");
        }
        assert_eq!(base64(b"+/+/").as_deref(), Some(&[0xFB, 0xFF, 0xBF][..]));
    }

    #[test]
    fn malformed_texts_are_none() {
        for text in ["%", "%4", "%4g", "%%41"] {
            assert_eq!(unquote_plus(text.as_bytes()), None, "{text}");
        }
        for text in ["Zg=", "Z===", "====", "Zm9v\n", "Zm=v", "Zm9*"] {
            assert_eq!(base64(text.as_bytes()), None, "{text}");
        }
    }

    proptest! {
        #[test]
        fn quoting_and_unquoting_return_any_bytes(plain in prop::collection::vec(any::<u8>(), 0..300)) {
            prop_assert_eq!(unquote_plus(quote_plus(&plain).as_bytes()), Some(plain));
        }

        #[test]
        fn any_bytes_are_decoded_without_panic(text in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = (unquote_plus(&text), base64(&text));
        }
    }
}
