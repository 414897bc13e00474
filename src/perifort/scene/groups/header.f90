!> The group `&scene`: the problem as a whole.
module pd_scene_groups_header
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, path_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type, change_harmless, change_refused
  implicit none (type, external)
  private
  public :: header_type, known_defaults, own_defaults

  !> Versions whose defaults are known.
  character(3), parameter :: known_defaults(2) = [character(3) :: '0.1', '0.2']
  !> Those of this version.
  character(*), parameter :: own_defaults = known_defaults(size(known_defaults))

  !> `&scene`
  type, extends(group_type) :: header_type
    character(path_length) :: title = ''
    integer :: dimension = 0                     !! 1, 2 or 3
    character(name_length) :: plane = 'stress'   !! 2D: 'stress' or 'strain'
    real(wp) :: thickness = 1.0_wp               !! 2D: h [m]
    real(wp) :: area = 1.0_wp                    !! 1D: cross section A [m2]
    real(wp) :: gravity(3) = unset               !! acceleration of all points [m/s2]
    character(name_length) :: precision = 'double' !! of bonds: 'double' or 'mixed'
    character(name_length) :: defaults = ''      !! a `known_defaults`; '' = those of this version
  contains
    procedure :: visit
    procedure, nopass :: change_of
  end type header_type

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(header_type), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys      !! the visitor: reads, describes, writes

    call keys%key('title', group%title, 'title of the scene')
    call keys%key('dimension', group%dimension, '', 'number of directions', required=.true., &
      & at_least=1, at_most=3)
    call keys%key('plane', group%plane, '2D: plane stress or plane strain', &
      & allowed=[character(6) :: 'stress', 'strain'])
    call keys%key('thickness', group%thickness, 'm', '2D: thickness h', above=0.0_wp)
    call keys%key('area', group%area, 'm2', '1D: cross section A', above=0.0_wp)
    call keys%key('gravity', group%gravity, 'm/s2', 'acceleration that acts on all points; in '// &
      & 'relaxation it grows over the load steps', default='none')
    call keys%key('precision', group%precision, 'of the bonds: mixed computes them in single '// &
      & 'precision, from a state in double precision (lattice families)', &
      & allowed=[character(6) :: 'double', 'mixed'])
    call keys%key('defaults', group%defaults, 'version of perifort whose defaults hold for '// &
      & 'keys that are not given', allowed=known_defaults, default="'"//own_defaults//"'")
  end subroutine visit

  !> The title does not change the problem; the keys that `defaults` sets are compared one by one.
  pure integer function change_of(key) result(change)
    character(*), intent(in) :: key  !! its name, '' for the group as a whole

    change = change_refused
    if (key == 'title' .or. key == 'defaults') change = change_harmless
  end function change_of

end module pd_scene_groups_header
