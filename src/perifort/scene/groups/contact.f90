!> The group `&contact`: points that share no intact bond push apart where they come close.
module pd_scene_groups_contact
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: contact_group, contact_normals

  !> Along what points push.
  character(8), parameter :: contact_normals(2) = [character(8) :: 'smoothed', 'centres']

  !> `&contact`
  type, extends(group_type) :: contact_group
    character(name_length), allocatable :: between(:)  !! bodies, or 'all'
    character(name_length) :: within = ''              !! a body whose pieces meet
    real(wp) :: stiffness = 1.0_wp                     !! over that of the bonds [-]
    real(wp) :: distance = unset                       !! at which it begins [m]
    character(name_length) :: normals = 'smoothed'     !! one of `contact_normals`
    real(wp) :: friction = 0.0_wp                      !! Coulomb's coefficient [-]
    real(wp) :: restitution = unset                    !! speed after over before [-]
    real(wp) :: damping = unset                        !! part of the critical one [-]
  contains
    procedure :: visit
  end type contact_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(contact_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys        !! the visitor: reads, describes, writes
    character(name_length) :: no_names(0)

    call keys%list('between', group%between, 'names of bodies that are never bonded with each '// &
      & 'other and touch, one of which may be rigid, or ''all'' for all bodies and their pieces', &
      & no_names)
    call keys%key('within', group%within, 'instead of between: name of a body whose pieces '// &
      & 'touch each other')
    call keys%key('stiffness', group%stiffness, '', 'stiffness of a pair over that of a bond', &
      & above=0.0_wp)
    call keys%key('distance', group%distance, 'm', 'distance of points below which they push; '// &
      & 'with a rigid body that of points from its surface', above=0.0_wp, &
      & default='0.9 of the smaller spacing; from a surface 0.5')
    call keys%key('normals', group%normals, 'along what points of different bodies '// &
      & 'push: normals of both surfaces, or the line between their centres', &
      & allowed=contact_normals)
    call keys%key('friction', group%friction, '', 'Coulomb''s coefficient of friction', &
      & at_least=0.0_wp)
    call keys%key('restitution', group%restitution, '', 'speed after an impact over that '// &
      & 'before it; forces of separation are less by its square', above=0.0_wp, at_most=1.0_wp, &
      & default='1')
    call keys%key('damping', group%damping, '', 'instead of restitution: viscous damping over '// &
      & 'the critical one of a pair', at_least=0.0_wp, default='0')
  end subroutine visit

end module pd_scene_groups_contact
